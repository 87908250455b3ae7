"""Where two routes share lanes: their vehicles follow each other there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from intersection_env.maps.meeting import NEVER, SWEPT_WIDTH, SharedLane
from intersection_env.maps.route import CompiledRoute

MERGED_DISTANCE = 1.0  # [m], ours: nearer than this to a lane's centreline, a vehicle is in that lane
MOST_SHARED = 2  # ours: as two routes around a roundabout do; the core keeps no more
GRID = 0.1  # [m]
AT_ONCE = 64  # ours: places looked at together; routes part and merge within a few metres of a lane that they share


class Run(NamedTuple):
    """Pieces that follow each other on both routes, from a first one on each."""

    first_a: int
    first_b: int
    pieces: int


def shared_lanes(index_a: int, a: CompiledRoute, index_b: int, b: CompiledRoute) -> list[SharedLane]:
    """The stretches that two routes share, in the order in which they lie on a.

    Raises:
        ValueError: they are more than the core keeps.
    """
    stretches = []
    for run in _runs(a, b):
        begin_a, begin_b = _begin(a, run.first_a), _begin(b, run.first_b)
        offset = begin_b - begin_a
        from_a = -NEVER if run.first_a == 0 else _where_near(a, b, begin_a)
        from_b = -NEVER if run.first_b == 0 else _where_near(b, a, begin_b)
        goes_on = run.first_a + run.pieces < len(a.pieces) and run.first_b + run.pieces < len(b.pieces)
        end = _where_apart(a, b, a.ends[run.first_a + run.pieces - 1]) if goes_on else NEVER
        stretches.append(SharedLane(index_a, index_b, from_a, from_b, end, offset))
    if len(stretches) > MOST_SHARED:
        raise ValueError(
            f'routes "{a.source.id}" and "{b.source.id}" share lanes in {len(stretches)} places; wanted at most'
            f" {MOST_SHARED}"
        )
    return stretches


def _runs(a: CompiledRoute, b: CompiledRoute) -> list[Run]:
    """The longest runs of pieces that both routes have."""
    place = {name: number for number, name in enumerate(b.pieces)}
    runs: list[Run] = []
    for number, name in enumerate(a.pieces):
        other = place.get(name)
        if other is None:
            continue
        last = runs[-1] if runs else None
        if last is not None and (number, other) == (last.first_a + last.pieces, last.first_b + last.pieces):
            runs[-1] = last._replace(pieces=last.pieces + 1)
        else:
            runs.append(Run(number, other, 1))
    return runs


def _begin(route: CompiledRoute, piece: int) -> float:
    return route.ends[piece - 1] if piece else 0.0


def _where_near(route: CompiledRoute, other: CompiledRoute, begin: float) -> float:
    """From where on the route stays near the other until they share a lane, which it does from `begin` on."""
    s = np.arange(0.0, begin + GRID, GRID)
    end = len(s) - 2  # where they share the lane they are near, whatever rounding says
    while end > 0:
        first = max(end - AT_ONCE, 0)
        far = np.flatnonzero(_distance(route, other, s[first:end]) >= MERGED_DISTANCE)
        if len(far):
            return float(s[first + far[-1] + 1])
        end = first
    return 0.0


def _where_apart(route: CompiledRoute, other: CompiledRoute, end: float) -> float:
    """Where the route leaves the other, after a lane that they share until `end`; the route's length if it stays."""
    s = np.arange(0.0, route.line.length, GRID)
    s = s[s > end - GRID]
    for first in range(0, len(s), AT_ONCE):
        apart = np.flatnonzero(_distance(route, other, s[first : first + AT_ONCE]) > SWEPT_WIDTH)
        if len(apart):
            return float(s[first + apart[0]])
    return float(route.line.length)


def _distance(route: CompiledRoute, other: CompiledRoute, s: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(shapely.distance(shapely.line_interpolate_point(route.line, s), other.line))
