"""What `make harden` runs: soak, obedience, fuzzers, the C++ example, the wheel alone."""
