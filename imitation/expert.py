"""What the recorded drivers saw and did: the expert's side of the imitation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imitation.tracks import each_track, replays
from intersection_env.constants import ACCELERATION
from intersection_env.scenes.scenes import Scenes


@dataclass(frozen=True)
class ExpertSteps:
    """Every recorded step of every recorded vehicle that acts in a split's replays.

    observation: (step, 12), the features in their units, with delta from the recorded order.
    acceleration: (step,) [m/s²], what takes the vehicle on to its next recorded speed.
    track: (step,) int32, an index into `ReplayWorlds.tracks`; its route (step,) int32, and half its length [m].
    """

    observation: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    track: NDArray[np.int32]
    route: NDArray[np.int32]
    half_length: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.acceleration)

    @classmethod
    def joined(cls, parts: Sequence[ExpertSteps]) -> ExpertSteps:
        """Those of several places, in a row; `track` then counts from 0 in each."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))


def expert_steps(scenes: str | Path | Scenes, split: str | None, gap: str | Path = "recording") -> ExpertSteps:
    """Replays every track of a split, each vehicle driving as it was recorded.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    worlds = replays(scenes, split, gap)
    parts: list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]] = []
    for drives in each_track(worlds):
        while drives.any():
            parts.append((worlds.expert_observation[drives], worlds.expert_acceleration[drives], worlds.track[drives]))
            np.clip(worlds.expert_acceleration / ACCELERATION, -1.0, 1.0, out=worlds.action)
            worlds.step()
            drives &= ~(worlds.terminated | worlds.truncated)
    observation, acceleration, track = (np.concatenate(one) for one in zip(*parts, strict=True))
    order = np.argsort(track, kind="stable")
    track, arrays = track[order], worlds.tracks.arrays
    half_length = 0.5 * arrays["track_length"][track]
    return ExpertSteps(observation[order], acceleration[order], track, arrays["track_route"][track], half_length)
