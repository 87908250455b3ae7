"""The command `python -m experiments.forecast`; the work is in `experiments/measure/forecast.py`."""

import tyro

from experiments.measure.forecast import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.forecast")))
