"""The command `python -m intersection_env.map_compiler`; the same as `python -m intersection_env.maps`."""

from intersection_env.command import run_command
from intersection_env.maps.__main__ import main

if __name__ == "__main__":
    run_command(main)
