"""The command `python -m experiments.report`."""

from experiments.report.report import main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(main)
