"""Nobody drives faster than it can: vehicles with a top speed of their own, down to the lowest that one may have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.policies.file import PolicyFile
from tests.support.busy_traffic import T
from tests.support.core_and_twin import core_predictor, replayed, weights
from tests.support.twins import CASES, as_traffic, random_assignment, random_case, random_networks

TOP_SPEEDS = (0.1, 0.3, 1.0, 5.0)  # [m/s]
ROUNDING = 1e-5


def alone(speed: float, top_speed: float) -> Traffic:
    """One vehicle on a free road."""
    return Traffic.of(T, [Vehicle("slow", "W-E", 20.0, speed, max_speed=top_speed)])


@pytest.mark.parametrize("top_speed", TOP_SPEEDS)
@pytest.mark.parametrize("start", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("policy", ["idm", "idm_calibrated", "gail", "ppo", "rollout_gradient"])
def test_a_slow_vehicle_is_never_faster_than_it_can(policy: str, start: float, top_speed: float) -> None:
    """start: the speed at the begin, as a share of the top speed."""
    prediction = Predictor.load(policy).predict(alone(start * top_speed, top_speed))
    assert prediction.speed.max() <= top_speed * (1.0 + ROUNDING)
    assert prediction.time_loss[0, 0] >= -ROUNDING


@pytest.mark.parametrize("top_speed", TOP_SPEEDS)
@pytest.mark.parametrize("start", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("policy", ["idm", "idm_calibrated"])
def test_the_idm_settles_at_a_low_top_speed(policy: str, start: float, top_speed: float) -> None:
    speed = Predictor.load(policy).predict(alone(start * top_speed, top_speed)).speed[0, :, 0].astype(np.float64)
    assert speed[-1] == pytest.approx(top_speed, rel=0.01)
    steps = np.diff(speed)
    changes = np.sign(np.where(np.abs(steps) > 1e-3 * top_speed, steps, 0.0))
    assert len(set(changes) - {0.0}) <= 1, "it swings"


@pytest.mark.parametrize("policy", ["gail", "ppo", "rollout_gradient"])
def test_a_network_faster_than_it_can_at_the_start_does_not_accelerate(policy: str) -> None:
    speed = Predictor.load(policy).predict(alone(4.0, 1.0)).speed[0, :, 0].astype(np.float64)
    assert (speed[1:] <= np.maximum(speed[:-1], 1.0) + ROUNDING).all()


@pytest.mark.parametrize("seed", range(12 * CASES))
def test_core_equals_twin_where_everybody_is_slow(seed: int) -> None:
    _, twin = random_case("bendplatz", 90_000 + seed)
    generator = np.random.default_rng(seed)
    tops = generator.choice(np.array(TOP_SPEEDS, np.float32), len(twin.route)).astype(np.float64)
    twin = replace(twin, max_speed=tops, speed=(twin.speed * 0.1).astype(np.float32).astype(np.float64))
    traffic = as_traffic(Intersection.load("bendplatz"), twin)
    gap, driving = random_networks(generator)
    assignment = random_assignment(traffic, generator)
    networks = PolicyFile("network", "network", weights(gap), weights(driving))
    how = {"gap": "network", "driver": "network", "gap_network": gap, "driver_network": driving}
    replayed(traffic, twin, core_predictor(traffic, networks), assignment, **how)
    rules = core_predictor(traffic, PolicyFile("critical_gap", "idm"))
    replayed(traffic, twin, rules, assignment, gap="critical_gap", driver="idm")
