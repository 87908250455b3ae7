"""The command `python -m experiments.real`; the work is in `experiments/measure/real.py`."""

import sys

import tyro

from experiments.measure.real import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.real")))
