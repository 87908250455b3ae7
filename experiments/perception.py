"""The command `python -m experiments.perception`; the work is in `experiments/measure/perception.py`."""

import tyro

from experiments.measure.perception import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.perception")))
