"""What predictions should come to: moments and the 10 s after them, recorded, or of a teacher on a free road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imitation.expert import expert_steps
from imitation.tracks import replays
from intersection_env.evaluation.moments import Moment
from intersection_env.features import Driving
from intersection_env.maps.intersection import Sample
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic, Vehicle

LEAST_STEPS = 5  # what is known for less than 1 s says nothing
STRETCH, FREE_ROAD = 2.0, 40.0  # [m], of a route; and to the lead of whoever drives freely
NEAR = 60.0  # [m], of a junction


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
    """A car alone, as a teacher drives it where nobody is recorded: beyond the view, and more slowly than anybody.

    Each begins at a random place of a random route, every other one near its junction, one in five at a standstill, the
    others at up to the allowed speed. What counts of its drive is where, with a free road, at most one in twenty of the
    recorded drivers is as slow.
    """
    slowest = [one for place in places for one in _slowest(place)]
    free = [(place.intersection, route) for place in places for route in place.intersection.routes]
    found: list[Example] = []
    while len(found) < count:
        chosen = int(generator.integers(len(free)))
        intersection, route = free[chosen]
        begin, end = (0.0, route.length) if len(found) % 2 else (route.junction[0] - NEAR, route.junction[1] + NEAR)
        place = float(generator.uniform(max(begin, 0.0), min(end, route.length)))
        allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
        speed = allowed * max(float(generator.uniform(-0.25, 1.0)), 0.0)
        alone = Traffic.of(intersection, [Vehicle("alone", route.id, place, speed)])
        drive = teacher.predict(alone)
        stretch = np.minimum(drive.position[0] / STRETCH, len(slowest[chosen]) - 1).astype(np.int64)
        scored = drive.present[0] & (drive.speed[0] < slowest[chosen][stretch])
        if scored.sum() > LEAST_STEPS:
            found.append(Example(alone, drive.position[0], drive.speed[0], scored))
    return found


def _slowest(scenes: Scenes) -> list[NDArray[np.float32]]:
    """Of each route, by stretches of it, the speed below which nobody on a free road is recorded [m/s].

    It is infinite where fewer than ten of such states are recorded.
    """
    steps, tracks = expert_steps(scenes, None), replays(scenes, None).tracks.arrays
    seen, route = steps.observation, tracks["track_route"][steps.track]
    is_free = (seen[:, Driving.ENTERS] > 0.0) & (seen[:, Driving.LEAD_DISTANCE] > FREE_ROAD)
    found = []
    for one in scenes.intersection.routes:
        own = seen[is_free & (route == one.index)]
        half = 0.5 * tracks["track_length"][steps.track][is_free & (route == one.index)]
        stretch = ((one.stop_line - own[:, Driving.DISTANCE_TO_STOP_LINE] - half) / STRETCH).astype(np.int64)
        speeds = [own[stretch == k, Driving.SPEED] for k in range(int(one.length / STRETCH) + 1)]
        found.append(np.array([np.quantile(here, 0.05) if len(here) >= 10 else np.inf for here in speeds], np.float32))
    return found
