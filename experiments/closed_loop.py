"""The command `python -m experiments.closed_loop`; the work is in `experiments/measure/validation_run.py`."""

import sys

import tyro

from experiments.measure.validation_run import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.closed_loop")))
