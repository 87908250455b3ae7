"""The command `python -m experiments.horizon`; the work is in `experiments/measure/horizon.py`."""

import sys

import tyro

from experiments.measure.horizon import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.horizon")))
