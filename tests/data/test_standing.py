"""Who never moves is parked beside the lanes, and traffic in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from intersection_env.maps.intersection import Intersection
from tests.support.built_scenes import projected, scenes_of, steady_traffic
from tests.support.recordings import Mover, on_route, standing, steady

WAITING = "stands all along, on a route"
NOWHERE = "stands all along, without a route"


def stop_line(bendplatz: Intersection, route: str) -> float:
    return bendplatz.routes[bendplatz.route_index(route)].stop_line


def others(bendplatz: Intersection, seconds: float) -> Mover:
    """A vehicle that is there as long as the recording is."""
    return on_route(bendplatz, "NW-SE", 90, 0.0, steady(200.0, 2.0), seconds)


def test_vehicle_that_waits_in_a_lane_of_one_route_takes_part(tmp_path: Path, bendplatz: Intersection) -> None:
    place = stop_line(bendplatz, "SE-SW") - 12.0
    waiting = standing(bendplatz, "SE-SW", 1, place, 0.0, 20.0, aside=0.4)
    projection = projected(tmp_path, bendplatz, [waiting, others(bendplatz, 20.0)])
    track = next(one for one in projection.tracks if one.id == "07/1")
    assert bendplatz.routes[track.route].id == "SE-SW"
    assert np.allclose(track.position, place, atol=0.05)
    assert len(track.position) == 101
    assert projection.dropped == {WAITING: 1}


def test_vehicle_that_waits_where_routes_part_cuts_the_stretch(tmp_path: Path, bendplatz: Intersection) -> None:
    waiting = standing(bendplatz, "NE-SW", 1, stop_line(bendplatz, "NE-SW") - 3.0, 40.0, 6.0)
    scenes, dropped = scenes_of(tmp_path, bendplatz, [*steady_traffic(bendplatz, 80.0), waiting])
    assert dropped[f"tracks: {NOWHERE}"] == 1
    assert "tracks: parked" not in dropped
    assert dropped["stretches: standing vehicle without a route"] == 1
    assert dropped["seconds: standing vehicle without a route"] == pytest.approx(8.2)
    assert len(scenes) == 2
    assert not any(track.id == "07/1" for scene in scenes for track in scene.tracks)


def test_vehicle_that_stands_far_from_the_junction_cuts_nothing(tmp_path: Path, bendplatz: Intersection) -> None:
    waiting = standing(bendplatz, "SW-NE", 1, 20.0, 40.0, 6.0)
    scenes, dropped = scenes_of(tmp_path, bendplatz, [*steady_traffic(bendplatz, 80.0), waiting])
    assert dropped[f"tracks: {NOWHERE}"] == 1
    assert len(scenes) == 1


def test_body_says_which_way_a_standing_vehicle_would_go(tmp_path: Path, bendplatz: Intersection) -> None:
    across = standing(bendplatz, "SE-SW", 1, stop_line(bendplatz, "SE-SW") - 12.0, 0.0, 20.0, turned=np.pi / 2)
    projection = projected(tmp_path, bendplatz, [across, others(bendplatz, 20.0)])
    assert projection.unassigned == {0: NOWHERE}


@pytest.mark.parametrize(
    ("route", "beyond", "aside", "seconds", "is_parked"),
    [
        ("NW-NE", 20.0, -3.4, 20.0, True),  # beside a lane of 3.2 m
        ("NW-NE", 20.0, -3.4, 10.0, True),
        ("NW-NE", 20.0, -1.7, 20.0, True),  # more than half of it beside the lane
        ("NW-NE", 20.0, -1.2, 20.0, False),  # less: nobody drives past in the lane
        ("NE-SW", 25.0, -1.5, 20.0, True),  # at the kerb of a lane of 5.1 m
        ("NE-SW", 25.0, -1.5, 10.0, False),  # there for a while only: it waits
        ("NE-SW", 25.0, 0.0, 20.0, False),  # in its middle
    ],
)
def test_parked_is_who_leaves_the_lane_to_others(
    tmp_path: Path, bendplatz: Intersection, route: str, beyond: float, aside: float, seconds: float, is_parked: bool
) -> None:
    stands = standing(bendplatz, route, 1, stop_line(bendplatz, route) + beyond, 0.0, seconds, aside)
    projection = projected(tmp_path, bendplatz, [stands, others(bendplatz, 20.0)])
    assert projection.dropped["parked"] == is_parked
    assert projection.dropped[WAITING] == (not is_parked)
