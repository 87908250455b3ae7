"""The command `python -m experiments.driven_gain`; the work is in `experiments/measure/driven_gain.py`."""

import sys

import tyro

from experiments.measure.driven_gain import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.driven_gain")))
