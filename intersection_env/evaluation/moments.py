"""Recorded moments from which to predict, and what became of them: what predictions are held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT, STEPS
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic

HORIZONS = (2.0, 4.0, 6.0, 8.0, 10.0)  # [s], paper, Section IV-C
EVERY = 1.0  # [s] ours: between two moments; nearer ones see nearly the same scene
SCORED = ("car", "truck_bus")  # bicycles take part, but are not scored
LEAST = round(HORIZONS[0] / DT)  # steps
LEAST_SEEN = round(1.0 / DT)  # steps, ours: who leaves sooner says nothing about a prediction


class Sightings(NamedTuple):
    """Vehicles when last seen up to a horizon: (sighting,) each; horizon is its number in `HORIZONS`, position in m."""

    horizon: NDArray[np.int64]
    step: NDArray[np.int64]
    vehicle: NDArray[np.int64]
    position: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moment:
    """One recorded moment from which to predict."""

    scene: Scene
    step: int
    traffic: Traffic
    """The vehicles present, in the order of the scene's tracks."""

    @property
    def time(self) -> float:
        """Since the scene's begin [s]."""
        return self.step * DT

    @property
    def full(self) -> bool:
        """Whether the scene lasts for the whole horizon from here."""
        return self.step + STEPS < self.scene.steps

    @cached_property
    def recorded(self) -> np.ma.MaskedArray[Any, np.dtype[np.float32]]:
        """The positions as they became: (time, vehicle) [m], masked where not recorded."""
        position = np.zeros((STEPS + 1, len(self.traffic)), np.float32)
        known = np.zeros(position.shape, np.bool_)
        for i, track in enumerate(self.tracks()):
            part = self.future(track)
            count = len(track.position[part])
            position[:count, i], known[:count, i] = track.position[part], track.observed[part]
        return np.ma.masked_array(position, ~known)

    @cached_property
    def speed(self) -> NDArray[np.float32]:
        """The speeds as they became: (time, vehicle) [m/s], 0 once a track has ended."""
        speed = np.zeros((STEPS + 1, len(self.traffic)), np.float32)
        for i, track in enumerate(self.tracks()):
            own = track.speed[self.future(track)]
            speed[: len(own), i] = own
        return speed

    @cached_property
    def scored(self) -> NDArray[np.bool_]:
        """(time, vehicle), a car or truck that is recorded then."""
        is_scored = np.array([track.road_user in SCORED for track in self.tracks()], np.bool_)
        return ~np.ma.getmaskarray(self.recorded) & is_scored

    def last_seen(self, within: int = STEPS) -> np.ma.MaskedArray[Any, np.dtype[np.int64]]:
        """(vehicle,), as of `last_seen`."""
        return last_seen(self.scored, within)

    @cached_property
    def sightings(self) -> Sightings:
        """Where everyone recorded at the start was when last seen up to each of the `HORIZONS`."""
        parts = []
        for number, horizon in enumerate(HORIZONS):
            last = self.last_seen(round(horizon / DT))
            vehicle = np.flatnonzero(~np.ma.getmaskarray(last))
            step = last.data[vehicle]
            parts.append((np.full(len(vehicle), number), step, vehicle, self.recorded.data[step, vehicle]))
        horizon_number, step, vehicle, position = (np.concatenate(one) for one in zip(*parts, strict=True))
        return Sightings(horizon_number, step, vehicle, position.astype(np.float64))

    def tracks(self) -> list[Track]:
        """The tracks of the vehicles present: (vehicle,)."""
        return [self.scene.track(id) for id in self.traffic.ids]

    def future(self, track: Track) -> slice:
        """Where in a track's arrays this moment and the horizon after it lie."""
        return slice(self.step - track.start, self.step - track.start + STEPS + 1)


def last_seen(scored: NDArray[np.bool_], within: int = STEPS) -> np.ma.MaskedArray[Any, np.dtype[np.int64]]:
    """The last step, of the first so many, at which each of some vehicles is recorded: who is scored *until last seen*.

    Args:
        scored: (time, vehicle), a car or truck that is recorded then.
        within: steps from the start.

    Returns:
        (vehicle,) steps; masked for who is not recorded at the start, or not 1 s later or more.
    """
    seen = scored[: within + 1]
    last = len(seen) - 1 - seen[::-1].argmax(axis=0)
    return np.ma.masked_array(last, ~(seen[0] & seen[LEAST_SEEN:].any(axis=0)))


def moments_of(scenes: Scenes, every: float = EVERY) -> tuple[list[Moment], dict[str, str]]:
    """One every so many seconds of every scene, as long as 2 s of it remain and anybody is there.

    Returns:
        The moments, and those refused because vehicles overlap in the recording: what was found, by moment.
    """
    found: list[Moment] = []
    refused: dict[str, str] = {}
    for scene in scenes:
        for step in range(0, scene.steps - LEAST, round(every / DT)):
            traffic = scenes.at(scene, step * DT)
            if traffic.overlaps:
                one, other = traffic.overlaps[0]
                refused[f"scene {scene.id}, {step * DT:.1f} s"] = f"vehicles {one} and {other} overlap"
            elif len(traffic):
                found.append(Moment(scene, step, traffic))
    return found, refused


def contested(found: Sequence[Moment]) -> list[Moment]:
    """Those with an open conflict."""
    return [moment for moment in found if len(moment.traffic.conflicts)]


def followed(found: Sequence[Moment]) -> list[Moment]:
    """Those with somebody to score until last seen: a car or truck recorded then, and 1 s later or more."""
    return [moment for moment in found if moment.last_seen().count()]


def thinned(found: Sequence[Moment], most: int) -> list[Moment]:
    """At most so many of the moments, evenly spread over them.

    Raises:
        ValueError: `most` is below 1.
    """
    if most < 1:
        raise ValueError(f"the number of moments must be at least 1, not {most}")
    places = np.linspace(0, len(found) - 1, min(most, len(found))).round().astype(np.int64)
    return [found[place] for place in places.tolist()]
