"""How far a driver ends up from the recorded one, when each drives alone among the recorded others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from agents.networks.driving import DrivingNetwork
from imitation.expert import WORLDS, each_track
from intersection_env.features import Driving
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.replay import ReplayWorlds

HORIZON = 50  # steps, 10 s
TO_LINE = Driving.DISTANCE_TO_STOP_LINE
HARD_BRAKING = 4.0  # [m/s²]; paper, that of s_brake


@dataclass(frozen=True)
class ReplayError:
    """Errors of the distance along the route 10 s after a vehicle's first recorded step."""

    rmse: float
    """[m]"""
    mad: float
    """Median of the absolute error [m]."""
    count: int
    """Vehicles recorded for so long, and not to blame for a collision before."""
    collisions: float
    """Share of all vehicles that were to blame for a collision within the 10 s."""
    line_runs: float
    """Share of the steps at delta = 0, since a vehicle was able to stop, in which it crossed its line."""


def replay_error(policy: DrivingNetwork, scenes: str | Path | Scenes, split: str | None) -> ReplayError:
    """Lets every recorded car and truck of a split be driven by the mean action, with the recorded order as delta.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    worlds = ReplayWorlds(scenes, split=split, worlds=WORLDS, autoreset="off")
    worlds.reset(seed=0)
    errors: list[np.ndarray] = []
    collided = crossed = held = 0
    for acts in each_track(worlds):
        waits = np.zeros(WORLDS, np.bool_)
        for _ in range(HORIZON):
            distance, speed, delta = worlds.observation[:, [TO_LINE, Driving.SPEED, Driving.ENTERS]].T
            waits = (delta == 0.0) & (distance >= 0.0) & (waits | (distance >= speed**2 / (2.0 * HARD_BRAKING)))
            with torch.no_grad():
                worlds.action[:] = torch.tanh(policy(torch.from_numpy(worlds.observation))).numpy()
            worlds.step()
            collided += int((acts & worlds.terminated).sum())
            held += int((acts & waits).sum())
            crossed += int((acts & waits & (worlds.observation[:, TO_LINE] < 0.0)).sum())
            acts &= ~(worlds.terminated | worlds.truncated)
        error = worlds.expert_observation[:, TO_LINE] - worlds.observation[:, TO_LINE]
        errors.append(error[acts])
    error = np.concatenate(errors)
    return ReplayError(
        rmse=float(np.sqrt(np.mean(error**2))),
        mad=float(np.median(np.abs(error))),
        count=len(error),
        collisions=collided / len(worlds.tracks.actors),
        line_runs=crossed / max(held, 1),
    )
