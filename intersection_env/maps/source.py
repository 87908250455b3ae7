"""The hand-written description of an intersection, and the centrelines that follow from it.

A source file is JSON: arms with their right of way, lanes as polylines in driving direction, and
routes as paths of lanes. Where one lane of a route ends apart from where the next begins, the
gap is bridged by a smooth curve, so an author draws straight lanes only. Inside the junction a route has such a curve,
a way drawn for it alone, or lanes of the junction that other routes take too, as around a roundabout.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.curve import Points, along, connect, wrap
from intersection_env.maps.name import check_name
from intersection_env.maps.source_entries import (
    Arm,
    Lane,
    RouteSource,
    check_directions,
    read_arm,
    read_free,
    read_lane,
    read_route,
    read_stop_line,
    read_yields,
)
from intersection_env.maps.source_values import check_keys, check_locations, each_key_once, entries

FORMAT = "intersection_env map source"
VERSION = 2
TURN_ANGLE = np.radians(30.0)  # ours: a route that bends less than this runs straight

KEYS = ("format", "version", "name", "about", "locations", "arms", "lanes", "stop_lines", "routes", "yields", "free")


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
            content = json.loads(Path(path).read_text(encoding="utf-8"), object_pairs_hook=each_key_once)
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
        check_keys("the map source", content, KEYS)
        name = check_name(content.get("name"))
        arms = {key: read_arm(key, value) for key, value in entries(content, "arms").items()}
        lanes = {key: read_lane(key, value) for key, value in entries(content, "lanes").items()}
        painted = entries({"stop_lines": {}} | content, "stop_lines")  # approaches without one end at theirs
        stop_lines = {key: read_stop_line(key, value, lanes) for key, value in painted.items()}
        routes = tuple(read_route(key, value, arms, lanes) for key, value in entries(content, "routes").items())
        if not routes:
            raise ValueError('"routes" is empty')
        for route in routes:
            check_directions(route, lanes)
        known = {route.id for route in routes}
        yields, free = read_yields(content.get("yields", []), known), read_free(content.get("free", []), known)
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


def _new(content: dict[str, Any]) -> str:
    """What makes a file of this version from one of an older one."""
    if content.get("version") != 1:
        return ""
    return (
        f'. In version {VERSION} who comes from an arm marked "stop" makes a stop. Set "version" to {VERSION}, and such'
        ' an arm to "yield" where nobody stops; import an imported map anew: python -m data.maps FILE --out NEW.json'
    )
