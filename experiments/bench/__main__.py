"""The command `python -m experiments.bench`."""

from experiments.bench.bench import main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(main)
