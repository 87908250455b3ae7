"""The command `python -m experiments.gap`; the work is in `experiments/measure/gap.py`."""

import sys

import tyro

from experiments.measure.gap import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.gap")))
