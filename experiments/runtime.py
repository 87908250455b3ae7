"""The command `python -m experiments.runtime`; the work is in `experiments/measure/runtime.py`."""

import tyro

from experiments.measure.runtime import Options, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.runtime")))
