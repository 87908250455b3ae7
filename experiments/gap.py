"""The command `python -m experiments.gap`; the work is in `experiments/measure/gap.py`."""

import tyro

from experiments.measure.gap import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.gap")))
