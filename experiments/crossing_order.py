"""The command `python -m experiments.crossing_order`; the work is in `experiments/measure/crossing_order.py`."""

import tyro

from experiments.measure.crossing_order import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.crossing_order")))
