"""The command `python -m experiments.returns`; the work is in `experiments/measure/environment_returns.py`."""

import sys

import tyro

from experiments.measure.environment_returns import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.returns")))
