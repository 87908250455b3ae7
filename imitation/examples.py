"""What predictions should come to: moments and the 10 s after them, recorded, or of a teacher on a free road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imitation.expert import expert_steps
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.empty_road import alone, free_drive
from intersection_env.evaluation.moments import Moment
from intersection_env.features import Driving
from intersection_env.maps.intersection import Route, Sample
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic

LEAST_STEPS = 5  # what is known for less than 1 s says nothing
STRETCH, FREE_ROAD = 2.0, 40.0  # [m], of a route; and to the lead of whoever drives freely
STANDS = 0.5  # [m/s]: who is slower does not drive, freely or not
NEAR = 60.0  # [m], of a junction
HARDEST = 3.0  # [m/s²], as recorded drivers brake for a turn
Floats = NDArray[np.float32]


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
    return [
        Example(one.traffic, np.asarray(one.recorded.data), one.speed, one.scored & one.scored[0]) for one in moments
    ]


def teacher_named(name: str) -> Predictor:
    """A policy that can teach free drives.

    Raises:
        ValueError, OSError: as of `Predictor.load`; or it does not drive by the IDM.
    """
    teacher = Predictor.load(name)
    if teacher.policy.driver != "idm":
        raise ValueError(f'teacher: "{name}" drives by "{teacher.policy.driver}"; free drives are taught by an IDM')
    return teacher


def free_examples(
    places: Sequence[Scenes], teacher: Predictor, count: int, generator: np.random.Generator
) -> list[Example]:
    """A car alone, from random places of random routes, until it leaves the map.

    Nobody is recorded beyond the view, nor, on a free road, as slow as somebody may be; on a map whose scenes are empty
    nobody is at all. So the car drives as a teacher that follows the IDM accelerates, as fast as that one drives on a
    free road, but up to the junction's end no faster than three in four of the recorded drivers. Every other one begins
    near a junction, one in five at a standstill, the others at up to the allowed speed.
    """
    profiles = [
        (place.intersection, route, _profile(teacher, place, route, recorded))
        for place in places
        for route, recorded in zip(place.intersection.routes, _recorded_speeds(place), strict=True)
    ]
    found: list[Example] = []
    while len(found) < count:
        intersection, route, profile = profiles[int(generator.integers(len(profiles)))]
        begin, end = (0.0, route.length) if len(found) % 2 else (route.junction[0] - NEAR, route.junction[1] + NEAR)
        place = float(generator.uniform(max(begin, 0.0), min(end, route.length)))
        allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
        speed = allowed * max(float(generator.uniform(-0.25, 1.0)), 0.0)
        start = alone(intersection, route, place, speed)
        position, speeds = _driven(place, speed, profile, teacher.policy.idm.acceleration)
        scored = position < route.length
        if scored.sum() > LEAST_STEPS:
            found.append(Example(start, position[:, None], speeds[:, None], scored[:, None]))
    return found


def _driven(position: float, speed: float, profile: Floats, acceleration: float) -> tuple[Floats, Floats]:
    """Positions and speeds of the next 10 s (time,), by the IDM's law of the free road."""
    rows = [(position, speed)]
    for _ in range(STEPS):
        wanted = float(profile[min(int(position / STRETCH), len(profile) - 1)])
        rate = acceleration * (1.0 - (speed / wanted) ** 4)
        rate = float(np.clip(rate, -abs(wanted - speed) / DT, abs(wanted - speed) / DT))
        faster = max(speed + DT * max(rate, -HARDEST), 0.0)
        position, speed = position + 0.5 * DT * (speed + faster), faster
        rows.append((position, speed))
    found = np.array(rows, np.float32)
    return found[:, 0], found[:, 1]


def _profile(teacher: Predictor, scenes: Scenes, route: Route, recorded: Floats) -> Floats:
    """How fast a car drives freely in each stretch of a route [m/s]."""
    places, speeds = free_drive(teacher, scenes.intersection, route)
    order = np.argsort(places, kind="stable")
    middle = (np.arange(len(recorded)) + 0.5) * STRETCH
    profile: Floats = np.minimum(np.interp(middle, places[order], speeds[order]), recorded).astype(np.float32)
    return profile


def _recorded_speeds(scenes: Scenes) -> list[Floats]:
    """Of each route, in each stretch, the speed that one in four exceeds of who is recorded on a free road [m/s].

    The others had to wait just before, many of them; who stands, though nothing holds it, does not count. It is
    infinite beyond the junction's end, as there is no turn to slow for, and where fewer than ten such states are
    recorded.
    """
    if not scenes.scenes:
        return [np.full(_stretches(one), np.inf, np.float32) for one in scenes.intersection.routes]
    steps = expert_steps(scenes, None)
    seen = steps.observation
    is_free = (seen[:, Driving.ENTERS] > 0.0) & (seen[:, Driving.LEAD_DISTANCE] > FREE_ROAD)
    is_free &= seen[:, Driving.SPEED] >= STANDS
    found = []
    for one in scenes.intersection.routes:
        own = is_free & (steps.route == one.index)
        position = one.stop_line - seen[own, Driving.DISTANCE_TO_STOP_LINE] - steps.half_length[own]
        stretch, speed = (position / STRETCH).astype(np.int64), seen[own, Driving.SPEED]
        fast = np.full(_stretches(one), np.inf, np.float32)
        for k in range(int(one.junction[1] / STRETCH)):
            if (here := stretch == k).sum() >= 10:
                fast[k] = np.quantile(speed[here], 0.75)
        found.append(fast)
    return found


def _stretches(route: Route) -> int:
    """How many of them a route has."""
    return int(route.length / STRETCH) + 1
