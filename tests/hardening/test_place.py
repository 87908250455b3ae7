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


@pytest.mark.parametrize(("speed", "meet"), [(8.0, True), (4.0, False)])
def test_who_comes_to_stand_beside_its_lead_where_lanes_part_has_collided_too(speed: float, meet: bool) -> None:
    """A car 3.7 m behind a bicycle that stands where its own lane leaves the car's."""
    intersection = Intersection.load("t_junction")
    line = intersection.routes[intersection.route_index("S-W")].stop_line
    ahead = intersection.routes[intersection.route_index("S-E")].stop_line
    main_road = intersection.routes[intersection.route_index("W-E")].stop_line
    vehicles = [
        Vehicle("bicycle", "S-E", ahead + 1.3, 0.0, 1.8, 0.6, 5.0),
        Vehicle("car", "S-W", line - 5.5, speed, 4.5),
        Vehicle("main road", "W-E", main_road - 30.0, 13.0),
    ]
    assert collided(Traffic.of(intersection, vehicles), Predictor.load("idm"), 10) == ({"car"} if meet else set())
