"""The twin by hand: drivers, networks and what a step does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.drive import idm
from tests.reference.intersection import Floats
from tests.reference.networks import Network, evaluate
from tests.reference.observe import Feature
from tests.reference.predict import predict
from tests.reference.traffic import Traffic
from tests.support.placing import BENDPLATZ, T_JUNCTION, place
from tests.support.random_traffic import random_traffic


def test_constant_velocity_moves_by_speed_times_time() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 100, 7)), driver="constant_velocity")
    np.testing.assert_allclose(result.position[:, 0], 149 - 102 + 7 * np.arange(51) * 0.2)
    assert (result.acceleration == 0).all()
    assert (result.speed == 7).all()
    np.testing.assert_allclose(result.time_loss, 10 * (1 - 7 / 13.8888889))


def test_vehicle_that_leaves_the_map_stays_where_it_left_and_loses_no_time() -> None:
    traffic = replace(place(T_JUNCTION, ("W-E", 0, 10)), position=np.array([315.0]))
    result = predict(T_JUNCTION, traffic, driver="constant_velocity")
    assert result.present[:, 0].tolist() == [True] * 3 + [False] * 48  # 315, 317, 319, 321
    assert result.position[-1, 0] == pytest.approx(321)
    assert result.speed[-1, 0] == 10
    assert result.time_loss[0] == pytest.approx(3 * 0.2 * (1 - 10 / 13.8888889))


def test_idm_alone_on_the_road_accelerates_as_by_hand() -> None:
    # s* = 1.5 + max(0, 10 - 10 * 17.8 / 6.3) = 1.5, (10 / 13.9)^4 = 0.72^4
    by_hand = 2.5 * (1 - 0.72**4 - 0.015**2)
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 100, 10)))
    assert result.acceleration[0, 0] == pytest.approx(by_hand, abs=1e-6)
    assert result.speed[1, 0] == pytest.approx(10 + 0.2 * by_hand, abs=1e-6)
    assert result.position[1, 0] == pytest.approx(47 + 2 + 0.02 * by_hand, abs=1e-6)


def test_idm_behind_a_lead_brakes_as_by_hand() -> None:
    desired = 1.5 + 10 + 10 * 4 / (2 * math.sqrt(10))
    assert idm(10, 20, 30, 6) == pytest.approx(2.5 * (1 - 1 / 16 - (desired / 30) ** 2))


def test_braking_is_limited_and_never_reverses() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 50, 13), ("W-E", 44, 0)), steps=20)
    assert result.acceleration[0, 0] == pytest.approx(-8)
    slow = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 50, 1), ("W-E", 45.9, 0)), steps=1)
    assert slow.speed[1, 0] == 0
    assert slow.acceleration[0, 0] == pytest.approx(-5)
    assert slow.position[1, 0] - slow.position[0, 0] == pytest.approx(0.1)


def test_last_acceleration_and_decision_repeat_the_step_before() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 60, 0)), steps=7)
    assert result.acceleration.shape == (8, 1)
    assert result.acceleration[7] == result.acceleration[6] != result.acceleration[5]


def test_replayed_decisions_give_the_same_prediction() -> None:
    traffic = random_traffic(BENDPLATZ, np.random.default_rng(6), 8)
    first = predict(BENDPLATZ, traffic)
    assert 0 < first.enters.mean() < 1
    again = predict(BENDPLATZ, traffic, delta=first.enters)
    np.testing.assert_array_equal(first.position, again.position)
    other = predict(BENDPLATZ, traffic, delta=~first.enters)
    np.testing.assert_array_equal(other.enters, ~first.enters)
    assert (first.position != other.position).any()


def test_permuting_vehicles_permutes_the_prediction() -> None:
    traffic = random_traffic(BENDPLATZ, np.random.default_rng(11), 8)
    order = np.random.default_rng(0).permutation(8)
    first = predict(BENDPLATZ, traffic)
    second = predict(BENDPLATZ, Traffic(*(getattr(traffic, name)[order] for name in Traffic.__dataclass_fields__)))
    np.testing.assert_array_equal(first.position[:, order], second.position)
    np.testing.assert_array_equal(first.enters[:, order], second.enters)
    assert first.minimum_distance == pytest.approx(second.minimum_distance)


# Networks


def tiny(inputs: int, weight: Floats, bias: float) -> Network:
    """One hidden unit and one output that doubles it."""
    hidden, output = (weight.reshape(1, inputs), np.array([bias])), (np.array([[2.0]]), np.array([0.5]))
    return Network(np.full(inputs, 1.0), np.full(inputs, 0.1), (hidden, output))


def test_networks_scale_their_inputs_and_bend_only_their_hidden_layers() -> None:
    network = tiny(2, np.array([1.0, -3.0]), 0.25)  # x = (1, 2): 1 - 6 + 0.25 = -4.75
    assert evaluate(network, np.array([11.0, 21.0]), "leaky_relu") == pytest.approx(2 * -0.0475 + 0.5)
    assert evaluate(network, np.array([11.0, 21.0]), "tanh") == pytest.approx(2 * math.tanh(-4.75) + 0.5)


def test_driving_network_sees_the_decision_and_gives_at_most_six() -> None:
    weight = np.zeros(12)
    weight[Feature.DELTA] = 10.0  # delta: (1 - 1) * 0.1 * 10 = 0, (0 - 1) * 0.1 * 10 = -1
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))
    result = predict(T_JUNCTION, traffic, driver="network", driver_network=tiny(12, weight, 0.0), steps=1)
    assert result.enters[0].tolist() == [False, True]
    by_hand = [6 * math.tanh(2 * math.tanh(-1) + 0.5), 6 * math.tanh(0.5)]
    np.testing.assert_allclose(result.acceleration[0], by_hand)
