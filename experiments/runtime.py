"""The command `python -m experiments.runtime`; the work is in `experiments/measure/runtime.py`."""

import sys

import tyro

from experiments.measure.runtime import Options, main

if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options, prog="python -m experiments.runtime")))
