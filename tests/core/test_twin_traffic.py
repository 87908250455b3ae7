"""The twin by hand: who leads, what is seen and what is measured."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.bodies import body_distance, circles_distance
from tests.reference.intersection import Map
from tests.reference.lead import lead, lead_gaps
from tests.reference.observe import Feature, observe
from tests.reference.pairs import conflicts
from tests.reference.predict import predict
from tests.reference.traffic import front
from tests.support.placing import BOTH, T_JUNCTION, place
from tests.support.random_traffic import random_traffic


def test_lead_is_in_range_up_to_one_hundred_metres() -> None:
    near = place(T_JUNCTION, ("W-E", 104, 5), ("W-E", 0, 3))
    assert lead(T_JUNCTION, near, np.ones(2, np.bool_), 0) == (1, 100.0, 3.0)
    far = place(T_JUNCTION, ("W-E", 104.01, 5), ("W-E", 0, 3))
    assert lead(T_JUNCTION, far, np.ones(2, np.bool_), 0) == (None, 100.0, 100 / 3.6)


def test_lead_turning_off_counts_until_its_rear_is_past_the_split() -> None:
    before = replace(place(T_JUNCTION, ("W-E", 0, 5), ("W-S", 0, 5)), position=np.array([140, 157.4]))
    assert lead_gaps(T_JUNCTION, before, 0, 1) == [pytest.approx(13.4)]  # rear 155.4 < 155.5
    assert lead_gaps(T_JUNCTION, replace(before, position=np.array([140, 157.6])), 0, 1) == []


def test_lead_coming_from_another_arm_counts_once_its_front_is_past_the_merge() -> None:
    before = replace(place(T_JUNCTION, ("W-E", 0, 5), ("S-E", 0, 5)), position=np.array([150, 98.9]))
    assert lead_gaps(T_JUNCTION, before, 0, 1) == []  # front 100.9 <= 101
    after = replace(before, position=np.array([150, 99.1]))
    assert lead_gaps(T_JUNCTION, after, 0, 1) == [pytest.approx(99.1 + 64.0820762 - 150 - 4)]
    assert lead_gaps(T_JUNCTION, after, 1, 0) == []


# Observation


def test_observation_lists_the_features_in_order() -> None:
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 25, 9), ("W-E", 40, 7))
    seen = observe(T_JUNCTION, traffic)
    np.testing.assert_allclose(seen.driving[2], [40, 7, 13.8888889, *[0] * 6, 11, 9, 0])
    columns = [Feature.D_STOP, Feature.SPEED, Feature.D_LEAD, Feature.V_LEAD, Feature.DELTA]
    np.testing.assert_allclose(seen.driving[0, columns], [30, 8, 100, 100 / 3.6, 0])
    np.testing.assert_allclose(seen.gap[0], [162.730374 - (153.5 - 34), 8, 25, 9])


# Outputs


def test_distance_between_bodies_is_between_their_bumpers_in_a_lane() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 0), ("W-E", 50, 0))
    assert body_distance(T_JUNCTION, traffic, 0, 1) == pytest.approx(10 - 2 - 2)
    assert circles_distance(T_JUNCTION, traffic, 0, 1) == pytest.approx(10 - 2 * 1 - 2 * 1)
    assert predict(T_JUNCTION, traffic, driver="constant_velocity").minimum_distance == pytest.approx(6)


def test_vehicles_whose_routes_do_not_touch_have_no_minimum_distance() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 5), ("E-W", 60, 5))
    assert predict(T_JUNCTION, traffic).minimum_distance == math.inf


def test_standing_vehicle_loses_all_its_time() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 0))
    assert predict(T_JUNCTION, traffic, driver="constant_velocity").time_loss == pytest.approx([10])


# Random traffic


@BOTH
def test_random_traffic_keeps_its_distances_and_has_conflicts(intersection: Map) -> None:
    generator, pairs = np.random.default_rng(5), 0
    for _ in range(10):
        traffic = random_traffic(intersection, generator, 8)
        pairs += len(conflicts(intersection, traffic))
        for i in range(8):
            gaps = [gap for j in range(8) if j != i for gap in lead_gaps(intersection, traffic, i, j)]
            assert min(gaps, default=1.0) >= 1.0
            assert front(traffic, i) > 0
            assert traffic.speed[i] <= 1.1 * min(50 / 3.6, traffic.max_speed[i]) + 1e-5
    assert pairs > 40
