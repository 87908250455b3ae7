"""Drivers keep to the rules in predictions: lines, assigned orders, gaps."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env import Predictor
from intersection_env.evaluation.obedience import Findings
from intersection_env.policies.file import PolicyFile
from tests.hardening.obedience import look_at_random
from tests.support.core_and_twin import weights
from tests.support.twins import CASES, random_networks


def findings(predictor: Predictor, seeds: range) -> Findings:
    found = Findings()
    for seed in seeds:
        look_at_random(predictor, seed, found)
    return found


@pytest.mark.parametrize("name", ["ppo", "gail", "gap", "idm_calibrated", "rollout_gradient"])
def test_a_shipped_driver_obeys(name: str) -> None:
    found = findings(Predictor.load(name), range(300 * CASES))
    assert not found.wrong
    assert found.held_steps > 10_000
    assert found.held_past_line > 100
    assert found.assigned_pairs > 300
    assert found.free_first > 50
    assert found.followers > 300


@pytest.mark.parametrize("seed", range(10))
def test_a_network_that_never_learned_anything_obeys(seed: int) -> None:
    """It is the limits that make it so, not the training."""
    gap, driving = random_networks(np.random.default_rng(seed))
    policy = PolicyFile("network", "network", weights(gap), weights(driving))
    assert not findings(Predictor(policy, "random"), range(100 * seed, 100 * seed + 20)).wrong


def test_a_driver_without_limits_would_be_found() -> None:
    """Constant velocity runs lines, whatever it is told."""
    found = findings(Predictor.load("constant_velocity"), range(200))
    assert any("runs its line" in line for line in found.wrong)
    assert any("before" in line for line in found.wrong)
    assert any("past its line" in line for line in found.wrong)
