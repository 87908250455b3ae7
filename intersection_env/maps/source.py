"""The hand-written description of an intersection, and the centrelines that follow from it.

A source file is JSON: arms with their right of way, lanes as polylines in driving direction, and
routes as paths of lanes. Where one lane of a route ends apart from where the next begins, the
gap is bridged by a smooth curve, so an author draws straight lanes only. Inside the junction a route has such a curve,
a way drawn for it alone, or lanes of the junction that other routes take too, as around a roundabout.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.curve import Points, along, connect, wrap
from intersection_env.maps.name import check_name

FORMAT = "intersection_env map source"
VERSION = 2
RIGHTS_OF_WAY = ("priority", "right_before_left", "yield", "stop", "all_way_stop", "roundabout")
STOPPING = ("stop", "all_way_stop")
LARGEST = 2000.0  # [m], ours: local metres; a farther point has another origin, and would take minutes to compile
MOST_LOCATION = 1_000_000  # ours: inD's ids are of one digit, ours of three
TURN_ANGLE = np.radians(30.0)  # ours: a route that bends less than this runs straight

KEYS = ("format", "version", "name", "about", "locations", "arms", "lanes", "stop_lines", "routes", "yields", "free")


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


class Piece(NamedTuple):
    """A stretch of a route: a lane, or the curve that leads to the next one (lane is then None).

    points: (point, 2) [m]; width: (point,) [m].
    """

    lane: str | None
    points: Points
    width: NDArray[np.float64]
    inside_junction: bool


@dataclass(frozen=True)
class MapSource:
    """A source file, read and checked."""

    name: str
    locations: tuple[int, ...]
    arms: dict[str, Arm]
    lanes: dict[str, Lane]
    stop_lines: dict[str, Points]
    """By the lane that ends there: (2, 2) [m], the two ends of the painted line."""
    routes: tuple[RouteSource, ...]
    yields: frozenset[tuple[str, str]]
    """Pairs of route ids for which the general rule is not enough: the first yields."""
    free: frozenset[frozenset[str]] = frozenset()
    """Pairs of route ids that do not conflict, however near they are drawn to each other."""

    @classmethod
    def read(cls, path: str | Path) -> MapSource:
        """The source file at `path`.

        Raises:
            ValueError: the file is not a map source, or contradicts itself; the message names where.
            OSError: the file cannot be read.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"), object_pairs_hook=_each_key_once)
            return cls._from_json(content)
        except FileNotFoundError:
            raise FileNotFoundError(f'map source "{path}": no such file; wanted a .json') from None
        except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise ValueError(f"{path}: not JSON: {error}") from None
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @classmethod
    def _from_json(cls, content: Any) -> MapSource:
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise ValueError(f'"format" must be "{FORMAT}"')
        if content.get("version") != VERSION:
            raise ValueError(f'"version" is {content.get("version")!r}, this package reads {VERSION}{_new(content)}')
        _known_keys("the map source", content, KEYS)
        name = check_name(content.get("name"))
        arms = {key: _arm(key, value) for key, value in _entries(content, "arms").items()}
        lanes = {key: _lane(key, value) for key, value in _entries(content, "lanes").items()}
        stop_lines = {key: _stop_line(key, value, lanes) for key, value in _entries(content, "stop_lines").items()}
        routes = tuple(_route(key, value, arms, lanes) for key, value in _entries(content, "routes").items())
        if not routes:
            raise ValueError('"routes" is empty')
        for route in routes:
            _check_directions(route, lanes)
        known = {route.id for route in routes}
        yields, free = _yields(content.get("yields", []), known), _free(content.get("free", []), known)
        for first, second in yields:
            if frozenset((first, second)) in free:
                raise ValueError(f'routes "{first}" and "{second}" are under "yields" and under "free"')
        return cls(name, check_locations(content.get("locations", [])), arms, lanes, stop_lines, routes, yields, free)

    def pieces(self, route: RouteSource) -> list[Piece]:
        """The route's lanes and the curves between them, in driving order and without gaps."""
        pieces: list[Piece] = []
        first, last = len(route.approach), len(route.approach) + len(route.interior)
        for number, name in enumerate(route.lanes):
            lane = self.lanes[name]
            if number:
                before = self.lanes[route.lanes[number - 1]]
                inside = route.inside if number == first else None
                curve = connect(before.points, lane.points) if inside is None else _joined(before, inside, lane)
                way = along(curve)
                width = np.interp(way, way[[0, -1]], [before.width[-1], lane.width[0]])
                pieces.append(Piece(None, curve, width, first <= number <= last))
            pieces.append(Piece(name, lane.points, lane.width, first <= number < last))
        return pieces

    def turn(self, route: RouteSource) -> str:
        """Whether the route turns "left" or "right" inside the junction, or runs "straight"; a U-turn is "left"."""
        if route.entry == route.exit:
            return "left"
        change = wrap(_heading_out(self.lanes[route.leaving[0]]) - _heading_in(self.lanes[route.approach[-1]]))
        return "left" if change > TURN_ANGLE else "right" if change < -TURN_ANGLE else "straight"

    def approach_heading(self, route: RouteSource) -> float:
        """The heading in which the route reaches the junction [rad]."""
        return _heading_in(self.lanes[route.approach[-1]])


def _joined(before: Lane, inside: Points, lane: Lane) -> Points:
    """A way inside the junction, its ends moved to the end of the lane before and the begin of the one behind."""
    share = (along(inside) / along(inside)[-1])[:, None]
    begin, end = before.points[-1] - inside[0], lane.points[0] - inside[-1]
    return np.asarray(inside + (1.0 - share) * begin + share * end)


def _heading_in(lane: Lane) -> float:
    """The heading at a lane's end [rad]."""
    east, north = lane.points[-1] - lane.points[-2]
    return float(np.arctan2(north, east))


def _heading_out(lane: Lane) -> float:
    """The heading at a lane's begin [rad]."""
    east, north = lane.points[1] - lane.points[0]
    return float(np.arctan2(north, east))


def _each_key_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of the file; JSON's own reader would keep the last of equal keys."""
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise ValueError(f'"{key}" is there twice in one object')
        content[key] = value
    return content


def _new(content: dict[str, Any]) -> str:
    """What makes a file of this version from one of an older one."""
    if content.get("version") != 1:
        return ""
    return (
        f'. In version {VERSION} who comes from an arm marked "stop" makes a stop. Set "version" to {VERSION}, and such'
        ' an arm to "yield" where nobody stops; import an imported map anew: python -m data.maps FILE --out NEW.json'
    )


def _is_word(text: str) -> bool:
    return text.split() == [text] and text.isprintable()


def _known_keys(where: str, value: dict[str, Any], known: tuple[str, ...]) -> None:
    for key in value:
        if key not in known:
            raise ValueError(f'{where} has an unknown key "{key}"; wanted {", ".join(known)}')


def _entries(content: dict[str, Any], key: str) -> dict[str, Any]:
    """What stands under a key, by name."""
    value = content.get(key)
    if not isinstance(value, dict):
        raise ValueError(f'"{key}" must be an object, not {type(value).__name__}')
    return value


def _check_object(where: str, value: Any, known: tuple[str, ...]) -> None:
    if not isinstance(value, dict):
        raise ValueError(f"{where} must be an object, not {type(value).__name__}")
    _known_keys(where, value, known)


def _points(where: str, value: Any, least: int, most: int | None = None) -> Points:
    try:
        points = np.array(value)
    except ValueError:  # rows of different lengths
        points = np.array(None)
    if points.dtype.kind not in "if":  # words, objects, whole numbers beyond 64 bits
        raise ValueError(f"{where} must be a list of [x, y]")
    points = points.astype(np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < least or (most and len(points) > most):
        raise ValueError(f"{where} must be at least {least} points [x, y], not an array of shape {points.shape}")
    if not np.isfinite(points).all() or (np.linalg.norm(np.diff(points, axis=0), axis=1) < 1e-3).any():
        raise ValueError(f"{where} must hold finite points in metres, each apart from the one before")
    far = np.flatnonzero((np.abs(points) > LARGEST).any(axis=1))
    if len(far):
        x, y = points[far[0]]
        raise ValueError(
            f"{where} holds [{x:g}, {y:g}]; wanted local metres, at most {LARGEST:g} from 0 (more is another origin)"
        )
    return points


def _positive(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < 1e3:
        raise ValueError(f"{where} must be a positive number, not {value!r}")
    return float(value)


def _arm(key: str, value: Any) -> Arm:
    where = f'arm "{key}"'
    if not _is_word(key) or "-" in key or "." in key:
        raise ValueError(f'{where} must be named by one word without "-" and ".": routes are named "SW-NE", "SW-NE.2"')
    _check_object(where, value, ("right_of_way", "speed_limit_kmh"))
    right = value.get("right_of_way")
    if right not in RIGHTS_OF_WAY:
        raise ValueError(f'{where}: "right_of_way" must be one of {RIGHTS_OF_WAY}, not {right!r}')
    return Arm(right, _positive(f'{where}: "speed_limit_kmh"', value.get("speed_limit_kmh")) / 3.6)


def _lane(key: str, value: Any) -> Lane:
    where = f'lane "{key}"'
    _check_object(where, value, ("width", "points"))
    points = _points(f'{where}: "points"', value.get("points"), 2)
    width = value.get("width")
    if not isinstance(width, list):
        return Lane(points, np.full(len(points), _positive(f'{where}: "width"', width)))
    if len(width) != len(points):
        raise ValueError(
            f'{where}: "width" lists {len(width)} numbers; wanted one, or one for each of {len(points)} points'
        )
    return Lane(points, np.array([_positive(f'{where}: "width"', one) for one in width]))


def _stop_line(key: str, value: Any, lanes: dict[str, Lane]) -> Points:
    if key not in lanes:
        raise ValueError(f'stop line "{key}": no lane of that name')
    return _points(f'stop line "{key}"', value, 2, 2)


def _route(key: str, value: Any, arms: dict[str, Arm], lanes: dict[str, Lane]) -> RouteSource:
    entry, dash, leave = key.partition("-")
    leave, dot, number = leave.partition(".")
    if not dash or entry not in arms or leave not in arms or (dot and not number.isdecimal()):
        raise ValueError(
            f'route "{key}" must be named by two arms, as "SW-NE", or "SW-NE.2" beside it; arms: {", ".join(arms)}'
        )
    _check_object(f'route "{key}"', value, ("approach", "inside", "exit"))
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
        return _points(f'route "{key}": "inside"', value, 2), ()
    for one in value:
        if one not in lanes:
            raise ValueError(f'route "{key}": "inside" must be a list of lanes, there is no lane {one!r} in {value!r}')
    return None, tuple(value)


def _check_directions(route: RouteSource, lanes: dict[str, Lane]) -> None:
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


def check_locations(value: Any) -> tuple[int, ...]:
    """A map's locations.

    Raises:
        ValueError: they are no list of such numbers.
    """
    if not isinstance(value, list) or not all(type(one) is int and 0 <= one <= MOST_LOCATION for one in value):
        raise ValueError(f'"locations" must be a list of integers from 0 to {MOST_LOCATION}, not {value!r}')
    return tuple(value)


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


def _yields(value: Any, known: set[str]) -> frozenset[tuple[str, str]]:
    pairs: set[tuple[str, str]] = set()
    for first, second in _pairs("yields", value, known):
        if first == second:
            raise ValueError(f'"yields" says that route "{first}" yields to itself')
        if (second, first) in pairs:
            raise ValueError(f'"yields" says that routes "{first}" and "{second}" each yield to the other')
        pairs.add((first, second))
    return frozenset(pairs)


def _free(value: Any, known: set[str]) -> frozenset[frozenset[str]]:
    pairs = set()
    for first, second in _pairs("free", value, known):
        if first == second:
            raise ValueError(f'"free" says that route "{first}" is free of itself')
        pairs.add(frozenset((first, second)))
    return frozenset(pairs)
