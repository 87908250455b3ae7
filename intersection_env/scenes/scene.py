"""A scene: a stretch of recorded traffic over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT

SPLITS = ("train", "development", "validation")
ROAD_USERS = ("car", "truck_bus", "bicycle")


@dataclass(frozen=True, eq=False, slots=True)  # there are thousands of them
class Track:
    """One vehicle of a scene, from the step at which it appears.

    position: (time,) of its centre along the route [m]; speed: (time,) [m/s]; acceleration: (time,)
    [m/s²]; all float32. observed: (time,) bool, recorded, or else extrapolated into the past.
    """

    id: str
    """As "03/17": recording and track."""
    road_user: str
    route: int
    """Index into the intersection's routes."""
    length: float
    width: float
    start: int
    """Step of the scene at which the vehicle appears."""
    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    observed: NDArray[np.bool_]

    @property
    def stop(self) -> int:
        """The first step of the scene at which the vehicle is no longer there."""
        return self.start + len(self.position)


@dataclass(frozen=True, eq=False)
class Scene:
    """A stretch of recorded traffic: `steps` states, 0.2 s apart."""

    id: str
    """As "03/2": recording and number."""
    recording: str
    split: str
    start: float
    """Time of the recording at which the scene begins [s]."""
    steps: int
    tracks: tuple[Track, ...]

    @property
    def duration(self) -> float:
        """From the first state to the last [s]."""
        return (self.steps - 1) * DT

    @cached_property
    def _by_id(self) -> dict[str, Track]:
        return {track.id: track for track in self.tracks}

    def track(self, id: str) -> Track:
        """The track of that id.

        Raises:
            KeyError: the scene has none.
        """
        if id not in self._by_id:
            raise KeyError(f'scene {self.id} has no track "{id}"; it has {", ".join(self._by_id) or "none"}')
        return self._by_id[id]
