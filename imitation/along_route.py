"""What a GAIL run has learned of a car alone on a route: acceleration, reward and value by place and speed.

python -m imitation.along_route runs/gail --map t_junction --route W-S
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro

from agents.networks.driving import Driver, DrivingNetwork
from agents.training.folder import CHECKPOINT
from imitation.discriminator import Discriminator
from imitation.empty_road_states import LENGTHS, Car, seen_alone
from intersection_env.command import run_command
from intersection_env.constants import ACCELERATION
from intersection_env.features import DRIVING_FEATURES
from intersection_env.maps.intersection import Intersection

PLACES = (-30.0, -20.0, -10.0, -3.0, 5.0, 15.0, 25.0, 35.0, 50.0, 70.0)
"""From the stop line [m]."""
SPEEDS = (0.0, 2.0, 5.0, 8.0)  # [m/s]


@dataclass(frozen=True)
class Options:
    """Of which run, and where."""

    run: Annotated[Path, tyro.conf.Positional]
    """The run folder of a GAIL training."""
    map: str = "t_junction"
    route: str = "W-S"


def along_route(options: Options) -> str:
    """The table, of the last checkpoint: a line a place; acceleration [m/s²], reward and value at each speed.

    Raises:
        OSError: there is no checkpoint, or no such map.
        ValueError: it is none of GAIL, or there is no such route.
    """
    if not (options.run / CHECKPOINT).exists():
        raise FileNotFoundError(
            f"{options.run}: no {CHECKPOINT} there; wanted the run folder of python -m imitation.gail"
        )
    state = torch.load(options.run / CHECKPOINT, weights_only=True)
    if "discriminator" not in state:
        raise ValueError(f"{options.run / CHECKPOINT}: no checkpoint of python -m imitation.gail")
    driver = Driver(DrivingNetwork(), DrivingNetwork(), 1.0)
    driver.load_state_dict(state["driver"])
    discriminator = Discriminator(*torch.ones(2, len(DRIVING_FEATURES)))
    discriminator.load_state_dict(state["discriminator"])
    intersection = Intersection.load(options.map)
    route = intersection.routes[intersection.route_index(options.route)]
    length = float(np.mean(LENGTHS))
    lines = [f"{'from line':>9} " + "".join(f"| {f'{speed:g} m/s':^22} " for speed in SPEEDS)]
    for place in PLACES:
        cars = [Car(route.index, route.stop_line + place, speed, length) for speed in SPEEDS]
        seen = torch.from_numpy(seen_alone(intersection, cars))
        with torch.no_grad():
            does, value = ACCELERATION * torch.tanh(driver.policy(seen)), driver.value(seen)
        rows = zip(does.tolist(), discriminator.reward(seen).tolist(), value.tolist(), strict=True)
        lines.append(f"{place:+9.0f} " + "".join(f"| {a:+6.2f} {r:+7.3f} {v:+7.3f} " for a, r, v in rows))
    return "\n".join(lines)


def main(options: Options) -> int:
    """Prints the table; returns the exit status."""
    try:
        print(along_route(options))
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m imitation.along_route")))
