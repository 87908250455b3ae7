"""States of an empty road: that nobody else is there, and where and how fast the car is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from imitation.empty_road_states import FASTEST, STANDING, empty_road_states
from imitation.expert import expert_steps
from intersection_env import Intersection
from intersection_env.constants import FREE_LEAD_SPEED, LEAD_RANGE
from intersection_env.features import Driving
from intersection_env.maps.intersection import shipped_maps
from intersection_env.scenes.places import ALL_SCENES

COUNT = 1000


@pytest.mark.parametrize("name", shipped_maps())
def test_car_is_alone_and_need_not_wait_but_for_its_stop(name: str) -> None:
    states = empty_road_states(Intersection.load(name), COUNT, np.random.default_rng(0))
    assert states.shape == (COUNT, 12)
    np.testing.assert_array_equal(states[:, Driving.LEAD_DISTANCE], np.float32(LEAD_RANGE))
    np.testing.assert_array_equal(states[:, Driving.LEAD_SPEED], np.float32(FREE_LEAD_SPEED))
    waits = states[:, Driving.ENTERS] == 0.0
    assert (states[waits, Driving.DISTANCE_TO_STOP_LINE] >= 0.0).all()
    assert waits.any() == any(route.must_stop for route in Intersection.load(name).routes)


def test_car_is_anywhere_on_the_map_and_stands_or_is_slow() -> None:
    map_ = Intersection.load("t_junction")
    states = empty_road_states(map_, COUNT, np.random.default_rng(0))
    to_line, speed, allowed = states[:, [Driving.DISTANCE_TO_STOP_LINE, Driving.SPEED, Driving.V_MAX]].T
    assert (speed >= 0.0).all()
    assert (speed <= FASTEST * allowed + 1e-3).all()
    assert abs(np.mean(speed == 0.0) - STANDING) < 4 * (STANDING * (1 - STANDING) / COUNT) ** 0.5
    assert np.quantile(speed[speed > 0.0] / allowed[speed > 0.0], [0.1, 0.9]) == pytest.approx(
        [0.1 * FASTEST, 0.9 * FASTEST], abs=0.05
    )
    farthest = max(route.stop_line for route in map_.routes), max(route.length for route in map_.routes)
    assert to_line.max() > 0.9 * farthest[0]
    assert to_line.min() < -0.9 * (farthest[1] - farthest[0])
    headings = states[:, Driving.HEADINGS : Driving.HEADINGS + 6]
    assert len(np.unique(headings.round(2), axis=0)) > 3 * len(map_.routes)


def test_states_follow_the_generator() -> None:
    map_ = Intersection.load("bendplatz")
    one, same, other = (empty_road_states(map_, 20, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("name", ALL_SCENES)
def test_no_recorded_vehicle_that_is_free_stands_before_its_line(name: Path) -> None:
    """Nobody ahead, no one to wait for, and more than 2 m to go: what it would do there no recording says."""
    seen = expert_steps(name, "train").observation
    free = (seen[:, Driving.LEAD_DISTANCE] > 60.0) & (seen[:, Driving.ENTERS] == 1.0)
    speed = seen[free & (seen[:, Driving.DISTANCE_TO_STOP_LINE] > 2.0), Driving.SPEED]
    assert len(speed) > 7000
    assert speed.min() > 1.0
