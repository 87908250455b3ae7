"""A track is found on the route that was driven, and each that is not is counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from intersection_env.maps.intersection import Intersection
from tests.support.built_scenes import projected
from tests.support.recordings import Floats, Mover, on_route, steady, walking

ROUTES = ["NW-NE", "NW-SW", "NW-SE", "NE-NW", "NE-SW", "NE-SE", "SW-NW", "SW-NE", "SW-SE", "SE-NW", "SE-NE", "SE-SW"]


def turning_back(time: Floats) -> Floats:
    return np.asarray(60.0 + 4.0 * time - 0.8 * np.maximum(time - 3.0, 0.0) ** 2)


def braking(position: float, speed: float, deceleration: float) -> Callable[[Floats], Floats]:
    return lambda time: np.asarray(position + speed * time - 0.5 * deceleration * time**2)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("aside", [0.0, 0.8, -0.8])
def test_track_is_found_on_its_route_within_centimetres(
    tmp_path: Path, bendplatz: Intersection, route: str, aside: float
) -> None:
    stop_line = bendplatz.routes[bendplatz.route_index(route)].stop_line
    motion = braking(stop_line - 30.0, 9.0, 0.5)
    projection = projected(tmp_path, bendplatz, [on_route(bendplatz, route, 1, 0.0, motion, 8.0, aside=aside)])
    (track,) = projection.tracks
    assert bendplatz.routes[track.route].id == route
    assert not projection.dropped
    time = np.linspace(0.0, 0.2 * (len(track.position) - 1), len(track.position))
    assert np.abs(track.position - motion(time)).max() < (0.03 if aside == 0.0 else 0.1)
    if aside == 0.0:
        assert np.abs(track.speed - (9.0 - 0.5 * time))[1:-1].max() < 0.15
    assert track.observed.all()
    assert track.start == 0
    assert track.id == "07/1"


def test_bicycle_gets_a_nominal_size(tmp_path: Path, bendplatz: Intersection) -> None:
    bicycle = on_route(bendplatz, "SW-NE", 1, 0.0, steady(60.0, 4.0), 12.0, "bicycle", aside=-1.5)
    (track,) = projected(tmp_path, bendplatz, [bicycle]).tracks
    assert (track.length, track.width, track.road_user) == (1.8, 0.6, "bicycle")


def test_each_reason_for_dropping_a_track_is_counted(tmp_path: Path, bendplatz: Intersection) -> None:
    across = np.linspace([20.0, -30.0], [90.0, -30.0], 251)
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 12.0),
        Mover(2, "car", 0, np.tile([[80.0, -90.0]], (300, 1))),
        Mover(3, "car", 0, across),
        on_route(bendplatz, "SW-NE", 4, 0.0, turning_back, 8.0),
        on_route(bendplatz, "SW-NE", 5, 0.0, steady(50.0, 5.0), 4.0),
        on_route(bendplatz, "SW-NE", 6, 3.0, steady(50.0, 8.0), 0.6),
        walking(7, 0.0, (80.0, -90.0), (90.0, -90.0), 8.0),
        on_route(bendplatz, "SE-NW", 8, 0.0, lambda t: 200.0 - 6.0 * t, 8.0),
    ]
    projection = projected(tmp_path, bendplatz, movers)
    assert [track.id for track in projection.tracks] == ["07/1"]
    assert projection.dropped == {
        **{"parked": 1, "fits no route": 1, "drives backwards": 2, "ambiguous route": 1},
        **{"shorter than 1 s": 1, "pedestrian": 1},
    }
    assert projection.unassigned == {
        2: "fits no route",
        3: "drives backwards",
        4: "ambiguous route",
        7: "drives backwards",
    }


def test_last_position_tells_routes_of_one_lane_apart(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NE-NW", 1, 0.0, steady(50.0, 5.0), 8.8),
        on_route(bendplatz, "NE-SW", 2, 0.0, steady(40.0, 5.0), 11.4),
        on_route(bendplatz, "NE-SE", 3, 0.0, steady(30.0, 5.0), 13.4),
    ]
    tracks = projected(tmp_path, bendplatz, movers).tracks
    assert [bendplatz.routes[track.route].id for track in tracks] == ["NE-NW", "NE-SW", "NE-SE"]


def test_track_seen_in_the_exit_lane_alone_is_kept(tmp_path: Path, bendplatz: Intersection) -> None:
    projection = projected(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(180.0, 8.0), 8.0)])
    (track,) = projection.tracks
    assert bendplatz.routes[track.route].id.endswith("-SE")


def test_track_that_leaves_the_map_ends_there(tmp_path: Path, bendplatz: Intersection) -> None:
    route = bendplatz.routes[bendplatz.route_index("NW-SE")]
    mover = on_route(bendplatz, "NW-SE", 1, 0.0, steady(300.0, 10.0), 1.9)
    step = (mover.centre[-1] - mover.centre[-2])[None] * np.arange(1, 101)[:, None]
    longer = Mover(1, "car", 0, np.concatenate([mover.centre, mover.centre[-1] + step]))
    (track,) = projected(tmp_path, bendplatz, [longer]).tracks
    assert 1 <= route.length - track.position[-1] + 1 < 4
    assert len(track.position) == 11
