"""The command `python -m experiments.horizon`; the work is in `experiments/measure/horizon.py`."""

import tyro

from experiments.measure.horizon import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.horizon")))
