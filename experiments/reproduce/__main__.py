"""The command `python -m experiments.reproduce`."""

import sys

import tyro

from experiments.reproduce.reproduce import main
from experiments.reproduce.workspace import Options

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.reproduce")))
