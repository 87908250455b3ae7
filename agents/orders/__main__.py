"""The command `python -m agents.orders`."""

import sys

import tyro

from agents.orders.train import COMMAND, PROFILES, main

if __name__ == "__main__":
    sys.exit(main(tyro.extras.overridable_config_cli(PROFILES, prog=COMMAND)))
