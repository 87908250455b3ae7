"""The command `python -m experiments.returns`; the work is in `experiments/measure/environment_returns.py`."""

import tyro

from experiments.measure.environment_returns import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.returns")))
