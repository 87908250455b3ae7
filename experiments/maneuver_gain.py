"""The command `python -m experiments.maneuver_gain`; the work is in `experiments/measure/maneuver_gain.py`."""

import tyro

from experiments.measure.maneuver_gain import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.maneuver_gain")))
