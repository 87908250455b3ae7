"""The command `python -m experiments.sumo_predictor`; the work is in `experiments/measure/sumo_errors.py`."""

import tyro

from experiments.measure.sumo_errors import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.sumo_predictor")))
