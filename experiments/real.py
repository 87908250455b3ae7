"""The command `python -m experiments.real`; the work is in `experiments/measure/real.py`."""

import tyro

from experiments.measure.real import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.real")))
