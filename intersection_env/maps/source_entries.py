"""The entries of a map source: arms, lanes, stop lines, routes and pairs of routes, each read and checked.

What an entry may not be is a ValueError that names it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.curve import Points
from intersection_env.maps.source_values import check_object, is_word, points_of, positive

RIGHTS_OF_WAY = ("priority", "right_before_left", "yield", "stop", "all_way_stop", "roundabout")
STOPPING = ("stop", "all_way_stop")


@dataclass(frozen=True)
class Arm:
    """One road that meets the intersection."""

    right_of_way: str
    speed_limit: float
    """[m/s]"""


@dataclass(frozen=True)
class Lane:
    """One lane, drawn in driving direction.

    points: (point, 2) [m]; width: (point,) [m].
    """

    points: Points
    width: NDArray[np.float64]


@dataclass(frozen=True)
class RouteSource:
    """A route from one arm to another: its lanes before and after the junction."""

    id: str
    entry: str
    exit: str
    approach: tuple[str, ...]
    leaving: tuple[str, ...]
    inside: Points | None = None
    """(point, 2) [m], the way inside the junction where it is drawn."""
    interior: tuple[str, ...] = ()
    """The junction's lanes that it takes, where it has no way of its own."""

    @property
    def lanes(self) -> tuple[str, ...]:
        """All of its lanes, in driving order."""
        return self.approach + self.interior + self.leaving


def read_arm(key: str, value: Any) -> Arm:
    """The arm of that name."""
    where = f'arm "{key}"'
    if not is_word(key) or "-" in key or "." in key:
        raise ValueError(f'{where} must be named by one word without "-" and ".": routes are named "SW-NE", "SW-NE.2"')
    check_object(where, value, ("right_of_way", "speed_limit_kmh"))
    right = value.get("right_of_way")
    if right not in RIGHTS_OF_WAY:
        raise ValueError(f'{where}: "right_of_way" must be one of {RIGHTS_OF_WAY}, not {right!r}')
    return Arm(right, positive(f'{where}: "speed_limit_kmh"', value.get("speed_limit_kmh")) / 3.6)


def read_lane(key: str, value: Any) -> Lane:
    """The lane of that name."""
    where = f'lane "{key}"'
    check_object(where, value, ("width", "points"))
    points = points_of(f'{where}: "points"', value.get("points"), 2)
    width = value.get("width")
    if not isinstance(width, list):
        return Lane(points, np.full(len(points), positive(f'{where}: "width"', width)))
    if len(width) != len(points):
        raise ValueError(
            f'{where}: "width" lists {len(width)} numbers; wanted one, or one for each of {len(points)} points'
        )
    return Lane(points, np.array([positive(f'{where}: "width"', one) for one in width]))


def read_stop_line(key: str, value: Any, lanes: dict[str, Lane]) -> Points:
    """(2, 2) [m], the ends of the painted line of the lane of that name."""
    if key not in lanes:
        raise ValueError(f'stop line "{key}": no lane of that name')
    return points_of(f'stop line "{key}"', value, 2, 2)


def read_route(key: str, value: Any, arms: dict[str, Arm], lanes: dict[str, Lane]) -> RouteSource:
    """The route of that id."""
    entry, dash, leave = key.partition("-")
    leave, dot, number = leave.partition(".")
    if not dash or entry not in arms or leave not in arms or (dot and not number.isdecimal()):
        raise ValueError(
            f'route "{key}" must be named by two arms, as "SW-NE", or "SW-NE.2" beside it; arms: {", ".join(arms)}'
        )
    check_object(f'route "{key}"', value, ("approach", "inside", "exit"))
    for part in ("approach", "exit"):
        names = value.get(part)
        if not isinstance(names, list) or not names or not all(isinstance(one, str) and one in lanes for one in names):
            words = [one for one in names if isinstance(one, str)] if isinstance(names, list) else []
            unknown = [one for one in words if one not in lanes]
            what = f"there is no lane {unknown[0]!r} in" if unknown else "not"
            raise ValueError(f'route "{key}": "{part}" must be a list of lanes, {what} {names!r}')
    inside, interior = _inside(key, value["inside"], lanes) if "inside" in value else (None, ())
    return RouteSource(key, entry, leave, tuple(value["approach"]), tuple(value["exit"]), inside, interior)


def _inside(key: str, value: Any, lanes: dict[str, Lane]) -> tuple[Points | None, tuple[str, ...]]:
    """A way inside the junction: drawn, or as lanes."""
    if not isinstance(value, list) or not value or not all(isinstance(one, str) for one in value):
        return points_of(f'route "{key}": "inside"', value, 2), ()
    for one in value:
        if one not in lanes:
            raise ValueError(f'route "{key}": "inside" must be a list of lanes, there is no lane {one!r} in {value!r}')
    return None, tuple(value)


def check_directions(route: RouteSource, lanes: dict[str, Lane]) -> None:
    """Refuses a lane that is drawn from its end to its begin, as seen from the one before or behind."""
    names = route.lanes
    if len(set(names)) < len(names):
        raise ValueError(f'route "{route.id}" uses a lane twice')
    ways = [(f'lane "{name}"', lanes[name].points) for name in names]
    if route.inside is not None:
        ways.insert(len(route.approach), ('"inside"', route.inside))
    for (one, before), (other, after) in pairwise(ways):
        gap = np.linalg.norm(after[0] - before[-1])
        for name, turned in ((one, after[0] - before[0]), (other, after[-1] - before[-1])):
            if np.linalg.norm(turned) < gap:
                raise ValueError(
                    f'route "{route.id}": {name} is drawn backwards, or {one} and {other} do not follow each other:'
                    f" {gap:.1f} m lie between them, and {np.linalg.norm(turned):.1f} m if it were turned"
                )


def read_yields(value: Any, known: set[str]) -> frozenset[tuple[str, str]]:
    """Pairs of known routes of which the first yields."""
    pairs: set[tuple[str, str]] = set()
    for first, second in _pairs("yields", value, known):
        if first == second:
            raise ValueError(f'"yields" says that route "{first}" yields to itself')
        if (second, first) in pairs:
            raise ValueError(f'"yields" says that routes "{first}" and "{second}" each yield to the other')
        pairs.add((first, second))
    return frozenset(pairs)


def read_free(value: Any, known: set[str]) -> frozenset[frozenset[str]]:
    """Pairs of known routes that do not conflict."""
    pairs = set()
    for first, second in _pairs("free", value, known):
        if first == second:
            raise ValueError(f'"free" says that route "{first}" is free of itself')
        pairs.add(frozenset((first, second)))
    return frozenset(pairs)


def _pairs(key: str, value: Any, known: set[str]) -> list[tuple[str, str]]:
    """A list of pairs of different routes."""
    if not isinstance(value, list):
        raise ValueError(f'"{key}" must be a list of pairs of route ids, not {value!r}')
    pairs = []
    for pair in value:
        if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(id, str) for id in pair):
            raise ValueError(f'"{key}" must hold pairs of route ids, not {pair!r}')
        for id in pair:
            if id not in known:
                raise ValueError(f'"{key}": there is no route "{id}" in {pair!r}; routes: {", ".join(sorted(known))}')
        pairs.append((pair[0], pair[1]))
    return pairs
