"""Centrelines of lanelets, smoothed and thinned to the points that tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from data.maps.bend import GRID, on_grid
from data.maps.lanelets import LaneMap
from intersection_env.maps.curve import Points

SPREAD = 1.5  # [m], ours: standard deviation of the smoothing; bounds are drawn with kinks
EXACT = 0.03  # [m], ours: points of a line that deviate less are left out


def polyline(lane_map: LaneMap, ids: Sequence[str]) -> tuple[Points, NDArray[np.float64]]:
    """The smoothed centreline along some lanelets (point, 2) and the width there (point,) [m]; both ends stay."""
    parts = [lane_map.lanelets[id].centre() for id in ids]
    points = np.concatenate([part[0] for part in parts])
    width = np.concatenate([part[1] for part in parts])
    kept = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-3]
    points, width = on_grid(points[kept], width[kept])
    return _smoothed(points), width


def telling(line: NDArray[np.float64], exact: float = EXACT) -> NDArray[np.int64]:
    """Indices of the points without which a line would be off by more than `exact` [m] (Douglas and Peucker).

    line: (point, 2), or (point, 3) with the width, which is then kept as exactly.
    """
    kept, open_ = {0, len(line) - 1}, [(0, len(line) - 1)]
    while open_:
        begin, end = open_.pop()
        if end - begin < 2:
            continue
        chord = line[end] - line[begin]
        inner = line[begin + 1 : end] - line[begin]
        off = inner - np.outer(inner @ chord / (chord @ chord), chord)
        away = np.linalg.norm(off, axis=1)
        if away.max() > exact:
            middle = begin + 1 + int(away.argmax())
            kept.add(middle)
            open_ += [(begin, middle), (middle, end)]
    return np.array(sorted(kept))


def _smoothed(points: Points) -> Points:
    """A Gaussian mean of the points; near the ends of the line turned by half, so that ends and headings stay."""
    reach = min(round(3.0 * SPREAD / GRID), len(points) - 1)
    if reach < 1:
        return points
    offset = np.arange(-reach, reach + 1)
    weight = np.exp(-0.5 * (offset * GRID / SPREAD) ** 2)
    begin = 2.0 * points[0] - points[reach:0:-1]
    end = 2.0 * points[-1] - points[-2 : -2 - reach : -1]
    longer = np.concatenate([begin, points, end])
    columns = [np.convolve(column, weight / weight.sum(), mode="valid") for column in longer.T]
    return np.stack(columns, axis=1)
