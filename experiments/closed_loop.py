"""The command `python -m experiments.closed_loop`; the work is in `experiments/measure/validation_run.py`."""

import tyro

from experiments.measure.validation_run import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.closed_loop")))
