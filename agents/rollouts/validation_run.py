"""How a driver does in the closed loop: the paper's validation run of 2000 s with 12 vehicles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tensordict import TensorDict

from agents.networks.driving import Driver, DrivingNetwork
from agents.rollouts.collector import Rollouts
from intersection_env.constants import DT
from intersection_env.features import Driving
from intersection_env.maps.intersection import Intersection
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.life import Bodies

STEPS = 10_000  # 2000 s; paper, Section IV-B.2
MEAN_ONLY = 1e-6
"""A deviation so small that actions are the mean."""
PART = 100  # steps a rollout


@dataclass(frozen=True)
class ValidationRun:
    """What came of a run."""

    reward: float
    """Mean of a step and vehicle, collisions included."""
    reward_between_collisions: float
    """Mean over the steps that ended no vehicle's life by its fault."""
    collisions: float
    """Vehicles to blame for one, a second and vehicle."""
    speed: float
    """Mean [m/s]."""
    seconds: float
    """Simulated, summed over worlds."""


def validation_run(
    policy: DrivingNetwork,
    *,
    map: str | Path | Intersection = "bendplatz",
    gap: str | Path,
    seed: int,
    worlds: int = 1,
    steps: int = STEPS,
    vehicles: int = 12,
    bodies: Bodies = "circles",
    watch: Callable[[TensorDict], None] | None = None,
) -> ValidationRun:
    """Drives by the mean action; worlds that end start anew.

    Args:
        policy: who drives.
        map: a map's name or file, or the map itself.
        gap: who decides about gaps, as of `ClosedLoopWorlds`.
        seed: of the worlds.
        worlds: side by side.
        steps: of each.
        vehicles: in each.
        bodies: by which they collide, as of `ClosedLoopWorlds`.
        watch: is shown each part of the run, as `Rollouts.collect` gives it.

    Raises:
        ValueError, OSError: as of `ClosedLoopWorlds`.
    """
    simulated = ClosedLoopWorlds(map, worlds=worlds, vehicles=vehicles, gap=gap, bodies=bodies)
    simulated.reset(seed, desynchronise=worlds > 1)
    driver = Driver(policy, DrivingNetwork(), MEAN_ONLY)
    reward = kept = speed = 0.0
    ended = count = 0
    whole, rest = divmod(steps, PART)
    parts = [Rollouts(simulated, PART)] * whole + ([Rollouts(simulated, rest)] if rest else [])
    for part in parts:
        data = part.collect(driver)
        if watch is not None:
            watch(data)
        paid, terminated = data["next", "reward"].double(), data["next", "terminated"]
        reward += float(paid.sum())
        kept += float(paid[~terminated].sum())
        speed += float(data["observation"][..., Driving.SPEED].double().sum())
        ended += int(terminated.sum())
        count += data.numel()
    return ValidationRun(
        reward=reward / count,
        reward_between_collisions=kept / max(count - ended, 1),
        collisions=ended / (count * DT),
        speed=speed / count,
        seconds=steps * worlds * DT,
    )
