"""The command `python -m experiments.bench`."""

from experiments.bench.bench import main

if __name__ == "__main__":
    main()
