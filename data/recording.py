"""A recording as every format's reader gives it, and every later step takes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

VEHICLES = ("car", "truck_bus", "bicycle")
PEDESTRIAN = "pedestrian"

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Ids = NDArray[np.int64] | NDArray[np.str_]


@dataclass(frozen=True)
class Recording:
    """One recording, track after track; the rows of track k are offsets[k] to offsets[k + 1].

    location: inD's id of the place; None where the format names none.
    track_id: (track,), numbers or words; road_user: one word per track, as "car"; length, width: (track,) [m], 0 where
    the format gives none; offsets: (track + 1,).
    frame: (row,), consecutive within a track; x, y: (row,) centre [m]; velocity: (row, 2) [m/s];
    acceleration: (row, 2) [m/s²]; heading: (row,) of the body [rad], meaningless where the track has no size.
    """

    id: str
    location: int | None
    frame_rate: float
    """[1/s]"""
    track_id: Ids
    road_user: tuple[str, ...]
    length: Floats
    width: Floats
    offsets: Integers
    frame: Integers
    x: Floats
    y: Floats
    velocity: Floats
    acceleration: Floats
    heading: Floats
    left_out: Mapping[str, int] = field(default_factory=dict)
    """What the reader did not take, by reason."""

    def resampled(self, dt: float) -> Recording:
        """The recording with one frame every `dt` seconds: those frames exactly, renumbered from 0.

        A track may be left without a row.

        Raises:
            ValueError: `dt` is no whole number of frames.
        """
        every = round(self.frame_rate * dt)
        if every < 1 or abs(self.frame_rate * dt - every) > 1e-6:
            raise ValueError(
                f"recording {self.id}: frameRate {self.frame_rate:g} has no whole number of frames in {dt} s"
            )
        kept = self.frame % every == 0
        count = np.concatenate([[0], np.cumsum(kept)])
        return replace(
            self,
            frame_rate=self.frame_rate / every,
            offsets=count[self.offsets],
            frame=self.frame[kept] // every,
            x=self.x[kept],
            y=self.y[kept],
            velocity=self.velocity[kept],
            acceleration=self.acceleration[kept],
            heading=self.heading[kept],
        )
