"""What predictions should come to: moments and the 10 s after them, recorded, or of a teacher on a free road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.evaluation.moments import SCORED, Moment
from intersection_env.maps.intersection import Route, Sample
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
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
    places: Sequence[Scenes], teacher: Predictor, count: int, generator: np.random.Generator
) -> list[Example]:
    """A car alone, as a teacher drives it where nobody is recorded: before the view, and from the junction's end on.

    Each begins at a random place of a random route's part there, one in five at a standstill, the others at up to the
    allowed speed; what counts is what it drives there, until it leaves the map.
    """
    free = [
        (place.intersection, route, *_view(place, route)) for place in places for route in place.intersection.routes
    ]
    found: list[Example] = []
    while len(found) < count:
        intersection, route, begin, end = free[int(generator.integers(len(free)))]
        place = float(generator.uniform(0.0, route.length - (end - begin)))
        place += (end - begin) * (place > begin)
        allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
        speed = allowed * max(float(generator.uniform(-0.25, 1.0)), 0.0)
        alone = Traffic.of(intersection, [Vehicle("alone", route.id, place, speed)])
        drive = teacher.predict(alone)
        position = drive.position[0]
        scored = drive.present[0] & ((position < begin) | (position > end))
        if scored.sum() > LEAST_STEPS:
            found.append(Example(alone, position, drive.speed[0], scored))
    return found


def _view(scenes: Scenes, route: Route) -> tuple[float, float]:
    """From where cars are recorded on a route, and the junction's end, from which on they drive freely [m]."""
    firsts = [
        float(track.position[track.observed].min())
        for scene in scenes
        for track in scene.tracks
        if track.route == route.index and track.road_user in SCORED and track.observed.any()
    ]
    return (min(firsts) if firsts else route.junction[0]), route.junction[1]
