"""Ways inside a junction are those that cars take: they cut the bend, within their lane."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from data.maps.bend import CAR, least_bent, on_grid, room_of
from intersection_env.maps.curve import Points

RADIUS = 8.0


def quarter() -> Points:
    """East for 15 m, a left turn of 8 m, north for 15 m."""
    angle = np.linspace(0.0, 0.5 * np.pi, 40)
    arc = np.stack([15.0 + RADIUS * np.sin(angle), RADIUS * (1.0 - np.cos(angle))], axis=1)
    (points,) = on_grid(np.concatenate([[[0.0, 0.0]], arc, [[15.0 + RADIUS, RADIUS + 15.0]]]))
    return points


def sharpest(points: Points) -> float:
    """The largest curvature over 2 m [1/m]."""
    heading = np.unwrap(np.arctan2(*np.diff(points, axis=0).T[::-1]))
    return float(np.abs(heading[4:] - heading[:-4]).max() / 2.0)


def test_a_turn_is_cut_within_the_lane() -> None:
    middle = quarter()
    taken = least_bent(middle, room_of(np.full(len(middle), 4.0)))
    away = shapely.distance(shapely.points(taken), shapely.LineString(middle))
    assert 0.7 < away.max() < 0.5 * (4.0 - CAR) + 1e-6
    assert sharpest(taken) < 0.85 * sharpest(middle)
    inner = np.array([15.0, RADIUS])  # the middle of the arc
    assert np.linalg.norm(taken - inner, axis=1).min() < RADIUS - 0.7


def test_ends_and_the_headings_there_stay() -> None:
    middle = quarter()
    taken = least_bent(middle, np.full(len(middle), 2.0))
    for part in (slice(0, 2), slice(-2, None)):
        assert np.array_equal(taken[part], middle[part])


def test_a_wider_lane_is_bent_less() -> None:
    middle = quarter()
    bends = [sharpest(least_bent(middle, np.full(len(middle), room))) for room in (0.0, 0.5, 1.0, 2.0)]
    assert bends == sorted(bends, reverse=True)
    assert bends[0] == sharpest(middle)


@pytest.mark.parametrize("count", [2, 4, 5, 60])
def test_a_straight_way_stays(count: int) -> None:
    line = np.stack([np.arange(count) * 0.5, np.full(count, 3.0)], axis=1)
    assert least_bent(line, np.full(count, 1.0)) == pytest.approx(line, abs=1e-6)


def test_lanes_narrower_than_a_car_leave_no_room() -> None:
    assert room_of(np.array([1.0, CAR, CAR + 1.0])) == pytest.approx([0.0, 0.0, 0.5])
    middle = quarter()
    assert np.array_equal(least_bent(middle, np.zeros(len(middle))), middle)
