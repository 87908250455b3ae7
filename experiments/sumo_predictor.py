"""The command `python -m experiments.sumo_predictor`; the work is in `experiments/measure/sumo_errors.py`."""

import sys

import tyro

from experiments.measure.sumo_errors import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.sumo_predictor")))
