"""The line that drivers take through a bend: of all that stay within their lane, the one that bends least."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.curve import Points, along

GRID = 0.5  # [m], ours: between the points of a line whose curvature counts
CAR = 1.8  # [m], ours: width of the car that stays within the lane
ENDS = 2  # ours: so many points at either end stay, and with them the headings there
STAYS = 1e-4  # [1/m⁴], ours: weight of the squared way aside beside the squared curvature; on a straight it decides


def on_grid(points: Points, *values: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """A line's points about `GRID` apart, both ends kept, and what is known at its points likewise."""
    way = along(points)
    grid = np.linspace(0.0, way[-1], max(2, round(way[-1] / GRID) + 1))
    x, y, *rest = (np.interp(grid, way, column) for column in (*points.T, *values))
    return np.column_stack([x, y]), *rest


def room_of(width: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far a car in the middle of lanes so wide may move aside (point,) [m]."""
    return np.maximum(0.5 * (width - CAR), 0.0)


def least_bent(points: Points, room: NDArray[np.float64]) -> Points:
    """The line of least bending beside another one.

    The middle of a lane turns around the kerb more sharply than cars do, which cut the bend; a driver model that sees
    the middle brakes for a curve that nobody drives.

    Args:
        points: (point, 2), `GRID` apart [m].
        room: (point,), how far each may move to either side [m]; both ends and the headings there stay.

    Returns:
        (point, 2): its sum of squared curvatures is the least, as far as those of small steps aside add up.
    """
    from scipy.optimize import lsq_linear

    free = np.flatnonzero(room > 0.0)
    free = free[(free >= ENDS) & (free < len(points) - ENDS)]
    if not len(free):
        return points
    ahead = np.gradient(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    second = np.diff(np.eye(len(points)), n=2, axis=0) / GRID**2
    bends = np.concatenate([second * left[:, axis] for axis in (0, 1)])
    matrix = np.concatenate([bends, np.sqrt(STAYS) * np.eye(len(points))])[:, free]
    wanted = np.concatenate([-(second @ points).T.ravel(), np.zeros(len(points))])
    aside = np.zeros(len(points))
    aside[free] = lsq_linear(matrix, wanted, (-room[free], room[free])).x
    return np.asarray(points + aside[:, None] * left)
