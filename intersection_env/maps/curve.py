"""The smooth curve by which a lane leads into the next one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CURVE_STEP = 0.25  # [m], ours: a polyline this fine deviates under 2 mm from a curve of 5 m radius
SHIFT = np.radians(10.0)  # ours: a lane that bends less than this into the next one is shifted, not turned

Points = NDArray[np.float64]
"""(point, 2): x and y [m]."""


def wrap(angle: float) -> float:
    """The angle in [-pi, pi) [rad]."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def along(points: Points) -> NDArray[np.float64]:
    """How far each point of a polyline is from its begin, along it: (point,) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def connect(before: Points, after: Points) -> Points:
    """A smooth curve from the end of one polyline to the start of the next: (point, 2) [m].

    A turn is a circular arc, as large as fits, with a straight remainder on the longer side; a
    lateral shift is a cubic Bezier curve.
    """
    start, end = before[-1], after[0]
    out, into = _direction(before[-2], before[-1]), _direction(after[0], after[1])
    distance = float(np.linalg.norm(end - start))
    if distance < 1e-6:
        return np.array([start, end])
    turn = _cross(out, into)
    angle = float(np.arctan2(turn, out @ into))
    if abs(angle) > SHIFT:
        ahead = _cross(end - start, into) / turn
        back = -_cross(end - start, out) / turn
        if ahead > 0.0 and back > 0.0:
            return _arc(start, end, out, ahead, back, angle)
    count = max(2, int(np.ceil(distance / CURVE_STEP)) + 1)
    u = np.linspace(0.0, 1.0, count)[:, None]
    after_start, before_end = start + out * distance * 0.45, end - into * distance * 0.45
    curve = (1 - u) ** 3 * start + 3 * (1 - u) ** 2 * u * after_start + 3 * (1 - u) * u**2 * before_end + u**3 * end
    return np.asarray(curve)


def _arc(start: Points, end: Points, out: Points, ahead: float, back: float, angle: float) -> Points:
    """A turn by `angle` [rad]; the straight ways on meet `ahead` of the start and `back` from the end [m]."""
    tangent = min(ahead, back)
    radius = tangent / np.tan(abs(angle) / 2.0)
    begin = start + out * (ahead - tangent)
    centre = begin + radius * (np.sign(angle) * _left(out))
    count = max(3, int(np.ceil(radius * abs(angle) / CURVE_STEP)) + 1)
    phi = np.linspace(0.0, angle, count)[:, None]
    spoke = begin - centre
    arc = centre + np.cos(phi) * spoke + np.sin(phi) * _left(spoke)
    return np.concatenate([start[None], arc, end[None]])


def _direction(begin: Points, end: Points) -> Points:
    """The unit vector (2,) from one point to another."""
    return np.asarray((end - begin) / np.linalg.norm(end - begin))


def _left(vector: Points) -> Points:
    """A vector (2,) turned by a quarter to the left."""
    east, north = vector
    return np.array([-north, east])


def _cross(one: Points, other: Points) -> float:
    """The cross product of two vectors (2,): positive where the other points to the left of the one."""
    (east, north), (other_east, other_north) = one, other
    return float(east * other_north - north * other_east)
