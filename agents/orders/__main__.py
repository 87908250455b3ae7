"""The command `python -m agents.orders`."""

import tyro

from agents.orders.train import COMMAND, PROFILES, main
from intersection_env.command import run_command

if __name__ == "__main__":
    run_command(lambda: main(tyro.extras.overridable_config_cli(PROFILES, prog=COMMAND)))
