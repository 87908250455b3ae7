"""What the recorded drivers saw and did: the expert's side of the imitation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import ACCELERATION
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.replay import ReplayWorlds

WORLDS = 256


@dataclass(frozen=True)
class ExpertSteps:
    """Every recorded step of every recorded vehicle that acts in a split's replays.

    observation: (step, 12), the features in their units, with delta from the recorded order.
    acceleration: (step,) [m/s²], what takes the vehicle on to its next recorded speed.
    track: (step,) int32, an index into `ReplayWorlds.tracks`.
    """

    observation: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    track: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.acceleration)


def each_track(worlds: ReplayWorlds) -> Iterator[NDArray[np.bool_]]:
    """Starts every track that may act, as many at a time as there are worlds; which worlds act (world,)."""
    actors, count = worlds.tracks.actors, len(worlds.action)
    for first in range(0, len(actors), count):
        tracks = actors[first : first + count]
        for world, track in enumerate(tracks):
            worlds.start(world, int(track))
        yield np.arange(count) < len(tracks)


def expert_steps(scenes: str | Path | Scenes, split: str | None, gap: str | Path = "recording") -> ExpertSteps:
    """Replays every track of a split, each vehicle driving as it was recorded.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    worlds = ReplayWorlds(scenes, split=split, gap=gap, worlds=WORLDS, autoreset="off")
    worlds.reset(seed=0)
    parts: list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]] = []
    for acts in each_track(worlds):
        while acts.any():
            parts.append((worlds.expert_observation[acts], worlds.expert_acceleration[acts], worlds.track[acts]))
            np.clip(worlds.expert_acceleration / ACCELERATION, -1.0, 1.0, out=worlds.action)
            worlds.step()
            acts &= ~(worlds.terminated | worlds.truncated)
    observation, acceleration, track = (np.concatenate(one) for one in zip(*parts, strict=True))
    order = np.argsort(track, kind="stable")
    return ExpertSteps(observation[order], acceleration[order], track[order])
