"""The command `python -m experiments.forecast`; the work is in `experiments/measure/forecast.py`."""

import sys

import tyro

from experiments.measure.forecast import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.forecast")))
