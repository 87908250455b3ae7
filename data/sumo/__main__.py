"""The command `python -m data.sumo`."""

from data.sumo.generate import main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(main)
