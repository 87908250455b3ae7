"""Lanes as the readers of maps give them: lanelets with their bounds, what follows what, and who yields."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from intersection_env.maps.curve import Points, along

STEP = 0.5  # [m], ours: between the points of a centreline
SIGNS = ("priority", "yield", "stop", "all_way_stop")


@dataclass(frozen=True)
class Lanelet:
    """A stretch of a lane between two bounds, both in driving direction.

    left, right: (point, 2) [m], not of equal length. successors: ids. speed_limit: [m/s], None where the map says
    none. signs: of `SIGNS`. stop_line: (2, 2) [m], where one is drawn.
    """

    id: str
    left: Points
    right: Points
    successors: tuple[str, ...] = ()
    speed_limit: float | None = None
    signs: frozenset[str] = frozenset()
    stop_line: Points | None = None

    def centre(self) -> tuple[Points, Points]:
        """The centreline (point, 2) and the width there (point,) [m]."""
        left, right = shapely.LineString(self.left), shapely.LineString(self.right)
        count = max(2, round(0.5 * (left.length + right.length) / STEP) + 1)
        share = np.linspace(0.0, 1.0, count)
        one, other = (
            shapely.get_coordinates(shapely.line_interpolate_point(bound, share, normalized=True))
            for bound in (left, right)
        )
        return 0.5 * (one + other), np.linalg.norm(one - other, axis=1)

    def cut(self, share: float) -> tuple[Lanelet, Lanelet]:
        """The parts before and behind a share of its length, the second under the id with a "+"."""
        begin, end = zip(*(_cut(bound, share) for bound in (self.left, self.right)), strict=True)
        behind = f"{self.id}+"
        first = replace(self, left=begin[0], right=begin[1], successors=(behind,), stop_line=None)
        return first, replace(self, id=behind, left=end[0], right=end[1])


@dataclass(frozen=True)
class RightOfWay:
    """Traffic on the lanelets `yields` waits for traffic on the lanelets `prior`; a stop where `stops`."""

    yields: frozenset[str]
    prior: frozenset[str]
    stops: bool


@dataclass
class LaneMap:
    """The lanelets of a map on which cars drive, by id, and what else it says.

    left_out: lanelets on which no car drives, by reason. ignored: what the reader does not know, by name.
    loose: pairs of lanelets of which the second follows the first though only one of their bounds does.
    origin: what was subtracted from UTM coordinates [m], in words.
    """

    lanelets: dict[str, Lanelet]
    rights: list[RightOfWay] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    ignored: Counter[str] = field(default_factory=Counter)
    loose: frozenset[tuple[str, str]] = frozenset()
    origin: str = "the file's own metres"

    def shifted(self, east: float, north: float) -> LaneMap:
        """The map moved by so much [m]."""
        by = np.array([east, north])
        moved = {
            id: replace(
                one,
                left=one.left + by,
                right=one.right + by,
                stop_line=None if one.stop_line is None else one.stop_line + by,
            )
            for id, one in self.lanelets.items()
        }
        return replace(self, lanelets=moved, origin=f"{self.origin}, moved by {east:g}, {north:g} m")

    def predecessors(self) -> dict[str, list[str]]:
        """By lanelet, those that lead into it."""
        found: dict[str, list[str]] = {id: [] for id in self.lanelets}
        for id, one in self.lanelets.items():
            for other in one.successors:
                found[other].append(id)
        return found

    def points(self) -> Iterator[Points]:
        """The bounds of all lanelets, each (point, 2) [m]."""
        for one in self.lanelets.values():
            yield one.left
            yield one.right


def _cut(points: Points, share: float) -> tuple[Points, Points]:
    way = along(points)
    at = share * way[-1]
    place = np.array([[np.interp(at, way, points[:, axis]) for axis in (0, 1)]])
    before, behind = points[way < at - 1e-6], points[way > at + 1e-6]
    return np.concatenate([before, place]), np.concatenate([place, behind])
