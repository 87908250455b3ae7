"""How far a driver gets from the recorded one, when each drives alone among the recorded others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from agents.networks.driving import DrivingNetwork
from imitation.torch_networks import Network, Networks, View
from imitation.tracks import each_track, replays
from intersection_env import _core
from intersection_env.constants import ACCELERATION, STEPS
from intersection_env.features import Driving
from intersection_env.scenes.places import each_place
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.replay import ReplayWorlds

TO_LINE = Driving.DISTANCE_TO_STOP_LINE


@dataclass(frozen=True)
class ReplayError:
    """Errors of the distance along the route so many steps after a vehicle's first recorded one."""

    rmse: float | None
    """[m]; None if there is no vehicle to score."""
    mad: float | None
    """Median of the absolute error [m], or None."""
    count: int
    """Vehicles recorded for so long, and not to blame for a collision before."""
    collisions: float
    """Share of all vehicles that were to blame for a collision within that time."""
    line_runs: float
    """Share of the steps at delta = 0, since a vehicle was able to stop, in which it crossed its line."""


def constant_velocity_network() -> DrivingNetwork:
    """A network that never accelerates: what others are compared with."""
    network = DrivingNetwork()
    for weights in network.parameters():
        torch.nn.init.zeros_(weights)
    return network


def replay_error(
    policy: DrivingNetwork,
    scenes: str | Path | Scenes | Sequence[Scenes],
    split: str | None,
    *,
    within_limits: bool = False,
    steps: int = STEPS,
) -> ReplayError:
    """Lets every recorded car and truck of a split be driven by the mean action, with the recorded order as delta.

    Args:
        policy: who drives.
        scenes: a scenes file's name or path, or the scenes of one place or several.
        split: of these.
        within_limits: whether it drives as in predictions, kept behind its lead and at its line.
        steps: after which it is compared.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    places = (scenes,) if isinstance(scenes, str | Path) else each_place(scenes)
    drive = _within_limits(policy) if within_limits else _freely(policy)
    every = [_driven(drive, replays(place, split), steps) for place in places]
    error = np.concatenate([one.error for one in every])
    return ReplayError(
        rmse=float(np.sqrt(np.mean(error**2))) if len(error) else None,
        mad=float(np.median(np.abs(error))) if len(error) else None,
        count=len(error),
        collisions=sum(one.collided for one in every) / sum(one.vehicles for one in every),
        line_runs=sum(one.crossed for one in every) / max(sum(one.held for one in every), 1),
    )


class _Driven(NamedTuple):
    """error: (vehicle,) [m]. vehicles, and those that collided. held, and of those crossed: steps at delta = 0."""

    error: NDArray[np.float32]
    vehicles: int
    collided: int
    held: int
    crossed: int


def _freely(policy: DrivingNetwork) -> Network:
    """Observations (world, 12) to actions (world,)."""
    return lambda seen: torch.tanh(policy(seen))


def _within_limits(policy: DrivingNetwork) -> Network:
    """As `_freely`, by the accelerations of a prediction."""
    networks = Networks(policy, policy)  # nobody asks about gaps
    return lambda seen: networks.drive(*View.of(seen)) / ACCELERATION


def _driven(drive: Network, worlds: ReplayWorlds, steps: int) -> _Driven:
    errors: list[NDArray[np.float32]] = []
    collided = crossed = held = 0
    for drives in each_track(worlds):
        waits = np.zeros(len(drives), np.bool_)
        for _ in range(steps):
            distance, speed, delta = worlds.observation[:, [TO_LINE, Driving.SPEED, Driving.ENTERS]].T
            waits = (delta == 0.0) & (distance >= 0.0) & (waits | (distance >= speed**2 / (2.0 * _core.BRAKING)))
            with torch.no_grad():
                worlds.action[:] = drive(torch.from_numpy(worlds.observation)).numpy()
            worlds.step()
            collided += int((drives & worlds.terminated).sum())
            held += int((drives & waits).sum())
            crossed += int((drives & waits & (worlds.observation[:, TO_LINE] < 0.0)).sum())
            drives &= ~(worlds.terminated | worlds.truncated)
        ahead = worlds.expert_observation[:, TO_LINE] - worlds.observation[:, TO_LINE]
        errors.append(ahead[drives])
    return _Driven(np.concatenate(errors), len(worlds.tracks.actors), collided, held, crossed)
