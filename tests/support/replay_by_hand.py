"""Small scenes by hand on the T-junction, in which the first vehicle acts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from tests.reference.worlds import Track
from tests.support.replay_cases import driven, replay, scene_of
from tests.support.world_traces import outputs
from tests.support.worlds_cases import Arrays

T = "t_junction"


def hand(*tracks: Track, decisions: str = "recording", name: str = T) -> _core.Replay:
    """One world in which the first of the tracks acts."""
    loop = replay(name, [scene_of(*tracks)], decisions=decisions)
    loop.reset(0, False)
    loop.start(0, 0)
    return loop


def go(loop: _core.Replay, steps: int, acceleration: float = 0.0) -> list[Arrays]:
    """The outputs of some steps, until the episode ends."""
    seen = []
    for _ in range(steps):
        loop.action[:] = acceleration / 6
        loop.step()
        seen.append(outputs(loop))
        if loop.terminated[0] or loop.truncated[0]:
            break
    return seen


def column(seen: list[Arrays], feature: int) -> NDArray[Any]:
    """(step,): a feature as the acting vehicle saw it."""
    return np.array([one["observation"][0, feature] for one in seen])


def foe_passing(seconds: float, speed: float = 10.0) -> Track:
    """On W-E, its front this long before it reaches the conflict with S-W (155.785958 m)."""
    return driven(T, "W-E", 155.785958 - 2 - seconds * speed, speed)


def yielding(seconds: float, speed: float = 4.0) -> Track:
    """On S-W, its front this long before it reaches the conflict with W-E (99.4648575 m)."""
    return driven(T, "S-W", 99.4648575 - 2 - seconds * speed, speed)
