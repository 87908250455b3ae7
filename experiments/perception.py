"""The command `python -m experiments.perception`; the work is in `experiments/measure/perception.py`."""

import sys

import tyro

from experiments.measure.perception import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.perception")))
