"""How slow vehicles get in turns, and how fast they are behind the junction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.build import build
from data.describe.speeds import slowest_in_junction, speed_behind_junction, turn_of
from intersection_env.maps.intersection import MAPS, Intersection
from intersection_env.maps.source import MapSource
from intersection_env.scenes.scenes import Scenes
from tests.support.recordings import Floats, on_route, steady, write_recording

SPACING = 7.0  # [s] between vehicles
SPEEDS = (4.0, 4.5, 5.0, 5.5, 6.0)  # [m/s]


def right_turns(folder: Path, bendplatz: Intersection, stands: bool = False) -> Scenes:
    """Five cars that turn right, one after the other, each at its own speed; the first one may stand on its way."""
    begin = bendplatz.routes[bendplatz.route_index("SE-NE")].junction[0] - 30.0

    def stop_and_go(time: Floats) -> Floats:
        return np.interp(time, [0.0, 8.0, 11.0, 20.0], [begin, begin + 33.0, begin + 33.0, begin + 80.0])

    movers = [
        on_route(bendplatz, "SE-NE", number, number * SPACING, steady(begin, speed), 80.0 / speed)
        for number, speed in enumerate(SPEEDS)
    ]
    if stands:
        movers[0] = on_route(bendplatz, "SE-NE", 0, 0.0, stop_and_go, 20.0)
    write_recording(folder, "07", movers)
    return build(folder, bendplatz, progress=False)


def test_slowest_speed_in_the_junction_is_that_of_those_who_never_stand_there(
    tmp_path: Path, bendplatz: Intersection
) -> None:
    found = slowest_in_junction(right_turns(tmp_path, bendplatz))
    assert found["straight"] is None
    assert found["left"] is None
    assert found["right"] is not None
    assert found["right"].median == pytest.approx(5.0, abs=0.2)
    assert (found["right"].low, found["right"].high) == pytest.approx((4.2, 5.8), abs=0.2)
    assert found["right"].vehicles == 5


def test_who_stands_in_a_turn_does_not_count_as_slow(tmp_path: Path, bendplatz: Intersection) -> None:
    assert slowest_in_junction(right_turns(tmp_path, bendplatz, stands=True))["right"] is None  # four are too few


def test_speed_behind_the_junction_is_a_mean_a_vehicle(tmp_path: Path, bendplatz: Intersection) -> None:
    found = speed_behind_junction(right_turns(tmp_path, bendplatz))
    assert found is not None
    assert found.median == pytest.approx(5.0, abs=0.2)
    assert found.vehicles == 5


def test_turns_of_the_compiled_map_are_those_of_its_source(bendplatz: Intersection) -> None:
    source = MapSource.read(MAPS / "bendplatz.json")
    for route in source.routes:
        assert turn_of(bendplatz, bendplatz.routes[bendplatz.route_index(route.id)]) == source.turn(route)
