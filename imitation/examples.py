"""What predictions should come to: moments and the 10 s after them, recorded, or of a teacher on a free road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.evaluation.moments import Moment
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic, Vehicle

LEAST_STEPS = 5  # what is known for less than 1 s says nothing


class Example(NamedTuple):
    """A traffic, and what became of it.

    position, speed: (time, vehicle) [m], [m/s], from now to 10 s. scored: (time, vehicle) bool, what counts of it.
    """

    traffic: Traffic
    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    scored: NDArray[np.bool_]


def recorded_examples(moments: Sequence[Moment]) -> list[Example]:
    """Recorded moments; what counts are cars and trucks that are recorded now, for as long as they are."""
    found = []
    for moment in moments:
        position = np.asarray(moment.recorded.data)
        speed = np.zeros_like(position)
        for i, track in enumerate(moment.tracks()):
            own = track.speed[moment.future(track)]
            speed[: len(own), i] = own
        found.append(Example(moment.traffic, position, speed, moment.scored & moment.scored[0]))
    return found


def free_examples(
    maps: Sequence[Intersection], teacher: Predictor, count: int, generator: np.random.Generator
) -> list[Example]:
    """A car alone, as a teacher drives it, from random places of random routes until it leaves the map.

    Nobody is recorded beyond the view, nor, at many a speed, on an empty road: there this says what to do. One in five
    begins at a standstill, the others at up to the allowed speed.
    """
    found: list[Example] = []
    while len(found) < count:
        intersection = maps[int(generator.integers(len(maps)))]
        route = intersection.routes[int(generator.integers(len(intersection.routes)))]
        place = float(generator.uniform(0.0, route.length))
        allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
        speed = allowed * max(float(generator.uniform(-0.25, 1.0)), 0.0)
        alone = Traffic.of(intersection, [Vehicle("alone", route.id, place, speed)])
        drive = teacher.predict(alone)
        if drive.present[0].sum() > LEAST_STEPS:
            found.append(Example(alone, drive.position[0], drive.speed[0], drive.present[0]))
    return found
