"""Networks in policy files and ONNX: the core and the predictor evaluate them as torch does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import (
    driving_policy,
    gap_hash,
    gap_network,
    network_weights,
    order_network,
    policy_file,
    save_onnx,
)
from agents.networks.gap import GapNetwork
from agents.networks.order import ORDER_SCALE, ORDER_SHIFT, OrderNetwork
from intersection_env import Predictor, _core
from intersection_env.constants import ACCELERATION
from intersection_env.features import ORDER_FEATURES, Driving
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import gap_decider
from tests.support.forecasts import NO_SPREAD
from tests.support.twins import random_case


def test_exported_gap_network_equals_torch_in_the_core_and_in_onnx(tmp_path: Path) -> None:
    torch.manual_seed(3)
    network = GapNetwork()
    generator = np.random.default_rng(0)
    features = generator.uniform([0, 0, -20, 0], [40, 15, 120, 20], (1000, 4)).astype(np.float32)
    with torch.no_grad():
        truth = network(torch.from_numpy(features)).numpy()
    policy_file(network, {"made_by": "a test"}).save(tmp_path / "a.policy")
    read = PolicyFile.read(tmp_path / "a.policy")
    with torch.no_grad():
        again = gap_network(read)(torch.from_numpy(features)).numpy()
    np.testing.assert_array_equal(again, truth)
    core = _core.Policy(read.text(), "a").evaluate_gap(features)
    np.testing.assert_allclose(core, truth, atol=1e-6)
    save_onnx(network, tmp_path / "a.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "a.onnx")
    np.testing.assert_allclose(session.run(None, {"features": features})[0], truth, atol=1e-6)
    with pytest.raises(ValueError, match='decides gaps by "sumo" and holds no gap network'):
        gap_network(PolicyFile("sumo", "idm"))


def test_exported_driving_network_equals_torch_in_the_core() -> None:
    network = DrivingNetwork()
    low = [-40.0, 0.0, 0.0, *[-np.pi] * 6, 0.0, 0.0, 0.0]
    high = [90.0, 20.0, 20.0, *[np.pi] * 6, 100.0, 28.0, 1.0]
    features = np.random.default_rng(0).uniform(low, high, (1000, 12)).astype(np.float32)
    with torch.no_grad():
        truth = network(torch.from_numpy(features)).numpy()
    text = driving_policy(gap_decider("gap"), network, {}).text()
    np.testing.assert_allclose(_core.Policy(text, "a test").evaluate_driving(features), truth, atol=1e-5)


def test_exported_order_network_equals_torch_in_the_core() -> None:
    torch.manual_seed(4)
    network = OrderNetwork()
    generator = np.random.default_rng(1)
    middle, deviation = (np.array(part) for part in (ORDER_SHIFT, 1.0 / np.array(ORDER_SCALE)))
    features = generator.normal(middle, deviation, (1000, len(ORDER_FEATURES))).astype(np.float32)
    with torch.no_grad():
        truth = network(torch.from_numpy(features)).numpy()
    policy = replace(PolicyFile("sumo", "idm"), order_network=network_weights(network), spread=NO_SPREAD)
    np.testing.assert_allclose(_core.Policy(policy.text(), "a test").evaluate_order(features), truth, atol=1e-5)
    read = order_network(PolicyFile.parse(policy.text(), "a test"))
    with torch.no_grad():
        np.testing.assert_array_equal(read(torch.from_numpy(features)).numpy(), truth)
    with pytest.raises(ValueError, match="the policy holds no order network"):
        order_network(PolicyFile("sumo", "idm"))


def test_what_is_made_from_a_decider_keeps_none_of_its_forecasts() -> None:
    """They are those of whoever drove by it."""
    assert Predictor.load("gap").policy.spread is not None
    made = driving_policy(gap_decider("gap"), DrivingNetwork(), {})
    assert made.order_network is None
    assert made.spread is None
    assert made.text().startswith("intersection_env policy 1\n")


def test_hash_of_what_decides_about_gaps_does_not_depend_on_forecasts() -> None:
    full = Predictor.load("gap").policy
    assert gap_hash(full) == gap_hash(gap_decider("gap")) == gap_hash(replace(full, about={}))
    assert gap_hash(full) != gap_hash(replace(full, gap="sumo", gap_network=None))


def test_predictor_drives_by_the_exported_network(tmp_path: Path) -> None:
    """Where its limits leave it free: nobody close ahead, and no line at which to wait; else it brakes the harder."""
    network = DrivingNetwork()
    driving_policy(gap_decider("gap"), network, {"made_by": "a test"}).save(tmp_path / "a.policy")
    predictor = Predictor.load(tmp_path / "a.policy")
    compared = 0
    for seed in range(40):
        traffic, _ = random_case("bendplatz", seed)
        seen = predictor.observe(traffic).driving
        with torch.no_grad():
            wanted = ACCELERATION * torch.tanh(network(torch.from_numpy(seen))).numpy()
        prediction = predictor.predict(traffic)
        drives = prediction.present[0, 0] & (prediction.speed[0, 1] > 0.0)
        done = prediction.acceleration[0, 0]
        assert (done[drives] <= wanted[drives] + 1e-4).all()
        to_line, to_lead, enters = (
            seen[:, k] for k in (Driving.DISTANCE_TO_STOP_LINE, Driving.LEAD_DISTANCE, Driving.ENTERS)
        )
        free = drives & (to_lead > 60.0) & ((enters == 1.0) | (to_line > 60.0))
        np.testing.assert_allclose(done[free], wanted[free], atol=1e-4)
        compared += int(free.sum())
    assert compared > 50
