"""The command `python -m experiments.crossing_order`; the work is in `experiments/measure/crossing_order.py`."""

import sys

import tyro

from experiments.measure.crossing_order import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.crossing_order")))
