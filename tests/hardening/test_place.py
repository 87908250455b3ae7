"""A look at a place tells jams after a collision from those that the model makes."""

from __future__ import annotations

import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from tests.hardening.place import collided


@pytest.mark.parametrize(("speed", "meet"), [(14.0, True), (4.0, False)])
def test_who_drives_through_another_has_collided_though_it_comes_free_again(speed: float, meet: bool) -> None:
    """A car 5 m behind a bicycle that rides off: at 14 m/s nothing stops it in time."""
    intersection = Intersection.load("bendplatz")
    line = intersection.routes[intersection.route_index("NW-SE")].stop_line
    vehicles = [
        Vehicle("bicycle", "NW-SE", line - 30.0, 0.0, 1.8, 0.6, 5.0),
        Vehicle("car", "NW-SE", line - 38.0, speed),
        Vehicle("far away", "NW-SE", line - 90.0, 10.0),
    ]
    traffic = Traffic.of(intersection, vehicles)
    predictor = Predictor.load("idm")
    assert collided(traffic, predictor, 30) == ({"bicycle", "car"} if meet else set())
    assert not predictor.predict(traffic).traffic_at(10.0).overlaps
