"""The model in plain torch does what the core does, step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from imitation.map_tables import MapTables
from imitation.torch_model import TorchPredictor
from intersection_env import Predictor, Scenes, _core
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.support.twins import CASES, random_assignment, random_case

TOLERANCE = 2e-3  # [m], [m/s], [s]; what 50 steps in float32 may lose


@pytest.fixture(scope="module")
def policy() -> PolicyFile:
    return Predictor.load("gail").policy


def test_an_all_way_stop_is_refused() -> None:
    with pytest.raises(
        ValueError, match='map "all_way_stop" has an all-way stop, which the model in torch does not know'
    ):
        MapTables.of([Intersection.load("all_way_stop")])


@pytest.mark.parametrize("name", [name for name in MAP_NAMES if name != "all_way_stop"])
@pytest.mark.parametrize("seed", range(12 * CASES))
def test_it_predicts_what_the_core_predicts(name: str, seed: int, policy: PolicyFile) -> None:
    """Without intervention, and with orders that are assigned in part."""
    traffic, _ = random_case(name, seed)
    if not len(traffic):
        pytest.skip("nobody is there")
    none = _core.complete(traffic.intersection.core, traffic.core, np.zeros((1, len(traffic.conflicts)), np.int8))
    orders = np.concatenate([random_assignment(traffic, np.random.default_rng(seed)), none])
    core = Predictor(policy, "core").predict(traffic, orders)
    states = list(TorchPredictor.of(traffic, policy).states(torch.from_numpy(orders)))
    assert len(states) == _core.STEPS
    for step, state in enumerate(states, 1):
        np.testing.assert_array_equal(state.present.numpy(), core.present[:, step])
        np.testing.assert_allclose(state.position.numpy(), core.position[:, step], atol=TOLERANCE)
        np.testing.assert_allclose(state.speed.numpy(), core.speed[:, step], atol=TOLERANCE)
    np.testing.assert_allclose(states[-1].time_loss.numpy(), core.time_loss, atol=TOLERANCE)


def test_it_knows_who_has_stopped_before(policy: PolicyFile) -> None:
    """Recorded vehicles that go on from their stop need not make another."""
    scenes, drives_on = Scenes.load("bendplatz").select("train"), 0
    for scene in scenes.scenes[:12]:
        for time in np.arange(0.0, scene.duration, 2.0):
            traffic = scenes.at(scene, float(time))
            if traffic.waited is None:
                continue
            none = np.zeros((1, len(traffic.conflicts)), np.int8)
            orders = _core.complete(traffic.intersection.core, traffic.core, none)
            *_, last = TorchPredictor.of(traffic, policy).states(torch.from_numpy(orders))
            core = Predictor(policy, "core").predict(traffic)
            np.testing.assert_allclose(last.position.numpy(), core.position[:, -1], atol=TOLERANCE)
            forgets = Predictor(policy, "core").predict(replace(traffic, waited=None))
            drives_on += int((np.abs(forgets.position[0, -1] - core.position[0, -1]) > 1.0).any())
    assert drives_on > 3, "nobody made a second stop"
