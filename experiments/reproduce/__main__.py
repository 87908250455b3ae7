"""The command `python -m experiments.reproduce`."""

import tyro

from experiments.reproduce.reproduce import main
from experiments.reproduce.workspace import Options
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.reproduce")))
