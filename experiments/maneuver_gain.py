"""The command `python -m experiments.maneuver_gain`; the work is in `experiments/measure/maneuver_gain.py`."""

import sys

import tyro

from experiments.measure.maneuver_gain import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.maneuver_gain")))
