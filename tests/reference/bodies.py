"""Bodies: how near to each other two vehicles are, as rigid rectangles and as the worlds' two circles."""

import math

import numpy as np

from tests.reference.intersection import Floats, Map, Sample, sample
from tests.reference.traffic import Traffic


def forward_and_centre(intersection: Map, traffic: Traffic, i: int) -> tuple[Floats, Floats]:
    """The direction of a vehicle, and where its centre is [m]. Beyond its last sample a route goes straight on."""
    route, position = int(traffic.route[i]), float(traffic.position[i])
    here = sample(intersection, route, position)
    forward = np.array([math.cos(here[Sample.HEADING]), math.sin(here[Sample.HEADING])])
    beyond = max(0.0, position - intersection.spacing * (len(intersection.routes[route].samples) - 1))
    return forward, here[[Sample.X, Sample.Y]] + beyond * forward


def corners(intersection: Map, traffic: Traffic, i: int) -> Floats:
    """(4, 2) [m], around the rectangle of a vehicle's length and width."""
    forward, centre = forward_and_centre(intersection, traffic, i)
    along, across = forward * traffic.length[i] / 2, np.array([-forward[1], forward[0]]) * traffic.width[i] / 2
    return np.array(
        [centre + along + across, centre - along + across, centre - along - across, centre + along - across]
    )


def overlap(a: Floats, b: Floats) -> bool:
    """Whether no side of the two rectangles (4, 2) separates them."""
    for side in (a[0] - a[1], a[1] - a[2], b[0] - b[1], b[1] - b[2]):
        if min(a @ side) > max(b @ side) or min(b @ side) > max(a @ side):
            return False
    return True


def from_side(point: Floats, begin: Floats, end: Floats) -> float:
    """How far a point is from a line between two others."""
    share = float((point - begin) @ (end - begin)) / float((end - begin) @ (end - begin))
    return float(np.hypot(*(point - begin - min(max(share, 0.0), 1.0) * (end - begin))))


def rectangle_distance(a: Floats, b: Floats) -> float:
    """Between two rectangles (4, 2), 0 where they overlap: else from a corner of one to a side of the other."""
    if overlap(a, b):
        return 0.0
    return min(
        from_side(corner, side_of[k], side_of[(k + 1) % 4])
        for corners_of, side_of in ((a, b), (b, a))
        for corner in corners_of
        for k in range(4)
    )


def body_distance(intersection: Map, traffic: Traffic, i: int, j: int) -> float:
    """The distance [m] between two bodies, 0 where they overlap."""
    return rectangle_distance(corners(intersection, traffic, i), corners(intersection, traffic, j))


def circles_distance(intersection: Map, traffic: Traffic, i: int, j: int) -> float:
    """The smallest distance [m] between the borders of two vehicles, each two circles of radius W/2 at ±L/4."""
    centres = []
    for k in (i, j):
        forward, centre = forward_and_centre(intersection, traffic, k)
        centres.append([centre + side * traffic.length[k] / 4 * forward for side in (-1, 1)])
    apart = min(float(np.hypot(*(p - q))) for p in centres[0] for q in centres[1])
    return apart - float(traffic.width[i] + traffic.width[j]) / 2
