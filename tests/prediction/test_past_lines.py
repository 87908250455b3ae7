"""Whoever stands past its line, behind one that waits there, blocks nobody: traffic beyond early lines clears."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from tests.hardening.place import look_at_place
from tests.support.single_lane_junction import single_lane_source

DRIVERS = ("idm", "rollout_gradient", "gail", "ppo")
EARLY = 22.0
"""From the centre to the lines [m], which leaves room for three cars between a line and the first conflict."""
EARLY_LINES: dict[str, Any] = {"near": EARLY, "yields": [("E-W", "S-N")]}
"""Right before left; but who comes from the east waits for who drives north."""


@pytest.fixture
def early(tmp_path: Path) -> Intersection:
    """Lines far before the conflicts."""
    path = tmp_path / "early_lines.json"
    path.write_text(single_lane_source(**EARLY_LINES))
    return Intersection.load(path)


def car(intersection: Intersection, id: str, route: str, beyond: float, speed: float) -> Vehicle:
    """A car of 4.5 m whose front is so far beyond its line."""
    line = intersection.routes[intersection.route_index(route)].stop_line
    return Vehicle(id, route, line + beyond - 2.25, speed)


def clears(predictor: Predictor, traffic: Traffic, seconds: int) -> bool:
    """Whether everybody leaves, and nobody collides."""
    for _ in range(seconds // 10):
        prediction = predictor.predict(traffic)
        assert prediction.minimum_distance[0] > 0.0
        traffic = prediction.traffic_at(10.0)
    return len(traffic) == 0


def room(intersection: Intersection, route: str) -> float:
    """Between a route's line and its first conflict [m]."""
    found = intersection.routes[intersection.route_index(route)]
    return found.first_conflict - found.stop_line


@pytest.mark.parametrize("driver", DRIVERS)
def test_nobody_lets_one_pass_that_stands_behind_one_that_waits_for_it(driver: str, early: Intersection) -> None:
    """The one behind has accepted its gap and can no longer stop at its line; who has priority must not wait for it."""
    front = room(early, "N-S") - 1.0
    cars = [
        car(early, "waits", "N-S", front, 0.0),
        car(early, "behind", "N-S", front - 8.0, 4.0),
        car(early, "from the right", "W-E", -8.0, 3.0),
    ]
    assert clears(Predictor.load(driver), Traffic.of(early, cars), 60)


@pytest.mark.parametrize("driver", DRIVERS)
def test_nobody_waits_for_one_that_stands_behind_one_that_waits_for_it(driver: str, early: Intersection) -> None:
    """The one behind, of another route, has priority over whom the one ahead waits for: that one is held, and goes."""
    front = room(early, "S-W") - 1.0
    cars = [
        car(early, "waits", "S-W", front, 0.0),
        car(early, "behind", "S-N", front - 6.5, 0.0),
        car(early, "from the right", "E-W", -2.0, 0.0),
    ]
    assert clears(Predictor.load(driver), Traffic.of(early, cars), 60)


@pytest.mark.parametrize(
    ("drawn", "traffics"),
    [(EARLY_LINES, 150), ({"near": 8.0, "far": 28.0}, 60), ({"near": 8.0, "far": 14.0}, 60)],
    ids=["early lines", "20 m before the lines", "6 m, less than a truck's length"],
)
def test_random_traffics_clear_whatever_the_room(tmp_path: Path, drawn: dict[str, Any], traffics: int) -> None:
    path = tmp_path / "drawn.json"
    path.write_text(single_lane_source(**drawn))
    looked = look_at_place(Intersection.load(path), traffics, twins=15)
    assert not looked.wrong
    assert looked.farthest < 1e-3
