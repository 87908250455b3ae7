"""How fast vehicles drive: through the junction by how they turn there, and behind it."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.curve import wrap
from intersection_env.maps.intersection import Intersection, Route, Sample
from intersection_env.maps.source import TURN_ANGLE
from intersection_env.scenes.scenes import Scenes

AROUND = 3.0  # [m], ours: a turn is slowest within the junction, or just before or behind it
STANDING = 0.5  # [m/s], ours: slower is standing
LEAST = 5  # ours: vehicles; fewer have no quantiles
TURNS = ("straight", "left", "right")


class Spread(NamedTuple):
    """10 %, 50 % and 90 % quantiles [m/s], and of how many vehicles."""

    low: float
    median: float
    high: float
    vehicles: int


def slowest_in_junction(scenes: Scenes) -> dict[str, Spread | None]:
    """By turn ("straight", "left", "right"), how slow a vehicle gets in the junction; None of fewer than five.

    Of cars and trucks that are recorded all through the junction and never stand in it: who waits says nothing of how
    a driver turns.
    """
    found: defaultdict[str, dict[str, float]] = defaultdict(dict)
    for scene in scenes:
        for track in scene.tracks:
            route = scenes.intersection.routes[track.route]
            begin, end = route.junction[0] - AROUND, route.junction[1] + AROUND
            inside = (track.position >= begin) & (track.position <= end)
            seen_all = track.position[0] < begin and track.position[-1] > end and track.observed[inside].all()
            if track.road_user != "bicycle" and seen_all and inside.any():
                slowest = float(track.speed[inside].min())
                if slowest >= STANDING:
                    found[turn_of(scenes.intersection, route)][track.id] = slowest
    return {turn: _spread(np.array(list(found[turn].values()))) for turn in TURNS}


def speed_behind_junction(scenes: Scenes) -> Spread | None:
    """Of cars and trucks whose rear has left the junction, each with its mean; None of fewer than five."""
    means = {}
    for scene in scenes:
        for track in scene.tracks:
            end = scenes.intersection.routes[track.route].junction[1]
            behind = track.observed & (track.position - 0.5 * track.length > end)
            if track.road_user != "bicycle" and behind.any():
                means[track.id] = float(track.speed[behind].mean())
    return _spread(np.array(list(means.values())))


def turn_of(intersection: Intersection, route: Route) -> str:
    """Whether a route turns "left" or "right" inside the junction, or runs "straight"."""
    ends = intersection.sample(route.index, np.array(route.junction, np.float32))[:, Sample.HEADING]
    change = wrap(float(ends[1] - ends[0]))
    return "left" if change > TURN_ANGLE else "right" if change < -TURN_ANGLE else "straight"


def _spread(values: NDArray[np.float64]) -> Spread | None:
    if len(values) < LEAST:
        return None
    low, median, high = np.quantile(values, [0.1, 0.5, 0.9])
    return Spread(float(low), float(median), float(high), len(values))
