"""What passes the gates may be the default, and the default does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env import Predictor, Scenes
from intersection_env.evaluation.empty_road import EmptyRoad
from intersection_env.evaluation.gates import LEAST_SPEED, MOST_COLLISIONS, Gates, collisions, gates
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned
from intersection_env.evaluation.obedience import Findings, obedience, random_order
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    return moments_of(small_scenes("development"))[0]


def test_default_passes_the_gates() -> None:
    moments = moments_of(Scenes.load("bendplatz").select("development"))[0]
    found = gates(Predictor.load(), thinned(moments, 500))
    assert found.refusals() == []
    assert found.passed
    assert found.obedience.assigned_pairs > 100


def test_constant_velocity_passes_none_of_them(moments: list[Moment]) -> None:
    found = gates(Predictor.load("constant_velocity"), moments)
    empty, slow, disobeys, collides = found.refusals()
    assert empty.startswith("0.00 of the calibrated IDM's speed on an empty road, wanted 0.5 (all_way_stop, ")
    assert slow.endswith("of the calibrated IDM's speed on an empty road in the mean, wanted 0.9")
    assert disobeys.startswith("disobeys ")
    assert collides.endswith("of the predictions, wanted at most 2%")
    assert not found.passed


def test_each_gate_refuses_by_itself() -> None:
    good = Gates(EmptyRoad(LEAST_SPEED, 1.0, "there", 1), Findings(), MOST_COLLISIONS)
    assert good.passed
    stands = replace(good, empty_road=EmptyRoad(0.49, 1.0, "there", 1))
    assert stands.refusals() == ["0.49 of the calibrated IDM's speed on an empty road, wanted 0.5 (there)"]
    slow = replace(good, empty_road=EmptyRoad(0.5, 0.89, "there", 1))
    assert slow.refusals() == ["0.89 of the calibrated IDM's speed on an empty road in the mean, wanted 0.9"]
    disobedient = replace(good, obedience=Findings(wrong=["runs its line", "again"]))
    assert disobedient.refusals() == ["disobeys 2 times, first runs its line"]
    assert replace(good, collisions=0.021).refusals() == ["collisions in 2.1% of the predictions, wanted at most 2%"]


def test_orders_looked_at_are_feasible_and_differ(moments: list[Moment]) -> None:
    traffic = max(contested(moments), key=lambda one: len(one.traffic.conflicts)).traffic
    generator = np.random.default_rng(0)
    orders = {random_order(traffic, generator).tobytes() for _ in range(20)}
    assert len(orders) > 3
    for order in orders:
        Predictor.load("idm").predict(traffic, np.frombuffer(order, np.int8))


def test_obedience_is_the_same_with_the_same_seed(moments: list[Moment]) -> None:
    policy = Predictor.load("ppo")
    assert str(obedience(policy, moments)) == str(obedience(policy, moments))
    assert str(obedience(policy, moments)) != str(obedience(policy, moments, seed=1))


def test_gates_without_moments_are_refused() -> None:
    with pytest.raises(ValueError, match="no moments to look at obedience"):
        obedience(Predictor.load("idm"), [])
    with pytest.raises(ValueError, match="no moments to look for collisions"):
        collisions(Predictor.load("idm"), [])
