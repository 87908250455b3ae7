"""How far each lane has to move aside, and the map source with its lanes moved."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from data.align.drives import Drive
from data.maps.bend import least_bent, on_grid
from data.maps.smooth import telling
from intersection_env.maps.curve import Points, along
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import Lane

STATION = 5.0  # [m], ours: between the places along a lane at which its shift is estimated
SMOOTH = 10.0  # [m], ours: over about this length a shift may change, and beyond the tracks it stays what it was
TOUCH = 0.1  # [m], ours: lanes that end nearer to where others begin are joined
JOINED = 1e6  # ours: weight of what the next lane does at a joint, beside 1 of where the cars drive
MOST_SHIFT = 4.0  # [m], ours: more than a lane is a mistake in the map, or tracks of another place
EASED = 0.3  # [m], ours: a way inside is straightened by so much: where cars drive is known no better, their curve is
CONSTANT = 0.1  # [m], ours: a shift that varies by less along its lane is taken as one for all of it
EXACT = 0.02  # [m], ours: points of a lane that deviate less are left out
DECIMALS = 2  # ours: centimetres


@dataclass(frozen=True)
class LaneShift:
    """A lane's way to the left.

    cars: how many drove on it. station: (station,) arc lengths along the lane [m]; left: (station,) [m].
    """

    cars: int
    station: NDArray[np.float64]
    left: NDArray[np.float64]

    def times(self, share: float) -> LaneShift:
        """A part of the shift."""
        return replace(self, left=share * self.left)


def lane_shifts(
    source: MapSource, intersection: Intersection, drives: Sequence[Drive], least_cars: int
) -> dict[str, LaneShift]:
    """The shifts of the lanes, and of the ways drawn inside the junction, on which at least so many cars drove.

    At each station it is the median over the cars of how far left they drive there, smoothed along the lane;
    where no car was seen it is what it is at the nearest place where some were. Lanes that follow each other stay
    joined: where they meet, the one that fewer cars drove on moves as far as the other.
    """
    seen: dict[str, list[tuple[NDArray[np.float64], NDArray[np.float64]]]] = defaultdict(list)
    lengths: dict[str, float] = {}
    by_id = {route.id: route for route in source.routes}
    for drive in drives:
        begin = 0.0
        for piece in source.pieces(by_id[intersection.routes[drive.route].id]):
            length = along(piece.points)[-1]
            on_lane = (drive.position >= begin) & (drive.position <= begin + length)
            name = piece.lane
            if piece.inside_junction and by_id[intersection.routes[drive.route].id].inside is not None:
                name = inside_of(intersection.routes[drive.route].id)
            if name is not None and on_lane.any():
                seen[name].append((drive.position[on_lane] - begin, drive.left[on_lane]))
                lengths[name] = length
            begin += length
    joints = following(source)
    moved = sorted((name for name, cars in seen.items() if len(cars) >= least_cars), key=lambda one: -len(seen[one]))
    found: dict[str, LaneShift] = {}
    for name in moved:
        before = [_end(found, one, -1) for one, other in joints if other == name and (one in found or one not in moved)]
        behind = [
            _end(found, other, 0) for one, other in joints if one == name and (other in found or other not in moved)
        ]
        found[name] = _smoothed(lengths[name], seen[name], before, behind)
    return found


def following(source: MapSource) -> list[tuple[str, str]]:
    """Lanes of which the second begins where the first ends; others are joined by a curve, which follows them."""
    chains = [chain for route in source.routes for chain in (route.approach, route.leaving)]
    pairs = {pair for chain in chains for pair in pairwise(chain)}
    ends = {(a, b): source.lanes[a].points[-1] - source.lanes[b].points[0] for a, b in pairs}
    return sorted(pair for pair, away in ends.items() if np.linalg.norm(away) < TOUCH)


def _end(found: Mapping[str, LaneShift], name: str, place: int) -> float:
    return float(found[name].left[place]) if name in found else 0.0


def inside_of(route_id: str) -> str:
    """What the drawn way of a route inside the junction is called among the shifts; no lane has a blank."""
    return f"inside {route_id}"


def shifted(source: MapSource, shifts: Mapping[str, LaneShift]) -> MapSource:
    """The source with these lanes moved to the left, points added where a shift varies; to the centimetre, as the file
    will hold them, so that what compiles now compiles then."""
    lanes = {name: _moved(lane, shifts[name]) if name in shifts else lane for name, lane in source.lanes.items()}
    routes = []
    drawn = any(inside_of(route.id) in shifts for route in source.routes)
    for route in source.routes:
        shift = shifts.get(inside_of(route.id))
        if shift is not None and route.inside is not None:
            moved = _moved(Lane(route.inside, np.ones(len(route.inside))), shift).points
            route = replace(route, inside=_eased(moved))
        routes.append(route)
    return replace(source, lanes=lanes, routes=tuple(routes) if drawn else source.routes)


def _eased(way: Points) -> Points:
    """A way inside the junction, straightened a little."""
    (points,) = on_grid(way)
    eased = least_bent(points, np.full(len(points), EASED))
    eased = eased[telling(eased)]
    return np.round(eased, DECIMALS) + 0.0


def _smoothed(
    length: float,
    cars: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
    before: Sequence[float],
    behind: Sequence[float],
) -> LaneShift:
    """The shift by what its cars say (position, left), and by what lanes before and behind it move there."""
    station = np.linspace(0.0, length, max(2, round(length / STATION) + 1))
    width = station[1] - station[0]
    each = np.full((len(cars), len(station)), np.nan)
    for car, (position, left) in enumerate(cars):
        nearest = np.rint(position / width).astype(np.int64)
        for one in np.unique(nearest):
            each[car, one] = np.median(left[nearest == one])
    count = np.isfinite(each).sum(axis=0)
    median = np.array(
        [np.median(column[np.isfinite(column)]) if n else 0.0 for n, column in zip(count, each.T, strict=True)]
    )
    # Least squares of (left - median), as many times as cars were seen, and of SMOOTH times its slope.
    slope = np.diff(np.eye(len(station)), axis=0) / width
    weight = count / count.max()
    for place, others in ((0, before), (-1, behind)):
        if others:
            weight[place], median[place] = JOINED, np.mean(others)
    matrix = np.diag(weight) + SMOOTH**2 * slope.T @ slope
    return LaneShift(len(cars), station, np.clip(np.linalg.solve(matrix, weight * median), -MOST_SHIFT, MOST_SHIFT))


def _moved(lane: Lane, shift: LaneShift) -> Lane:
    way = along(lane.points)
    varies = float(np.ptp(shift.left)) > CONSTANT
    place = np.union1d(way, shift.station[1:-1]) if varies else way
    place = place[np.concatenate([[True], np.diff(place) > 0.1])]
    place[-1] = way[-1]
    points = np.stack([np.interp(place, way, lane.points[:, axis]) for axis in (0, 1)], axis=1)
    left = np.interp(place, shift.station, shift.left) if varies else np.full(len(place), np.median(shift.left))
    points = points + left[:, None] * _normals(points)
    width = np.interp(place, way, lane.width)
    kept = telling(np.column_stack([points, width]), EXACT)
    return Lane(np.round(points[kept], DECIMALS) + 0.0, np.round(width[kept], DECIMALS))


def _normals(points: Points) -> Points:
    """(point, 2): to the left, so long that both lines which meet in a point move by 1."""
    step = np.diff(points, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    left = np.stack([-step[:, 1], step[:, 0]], axis=1)
    before, after = np.concatenate([left[:1], left]), np.concatenate([left, left[-1:]])
    between = before + after
    return np.asarray(2.0 * between / (between**2).sum(axis=1)[:, None])
