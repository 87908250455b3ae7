"""Networks in policy files and ONNX: the core and the predictor evaluate them as torch does."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from numpy.typing import NDArray

from agents.export import NETWORKS, SUFFIXES, main
from agents.networks.driving import DrivingNetwork
from agents.networks.export import (
    driving_policy,
    gap_hash,
    gap_network,
    network_weights,
    order_network,
    policy_file,
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


@pytest.mark.parametrize("form", ["onnx", "torch"])
@pytest.mark.parametrize("network", ["gap", "driving", "orders"])
def test_exported_networks_give_what_the_core_gives(
    network: str, form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Features as the core sees them in traffic, one row and many; the file says what they are."""
    out = tmp_path / "new" / f"a{SUFFIXES[form]}"
    assert main(["rollout_gradient", "--network", network, "--to", form, "--out", str(out)]) == 0
    assert f"written: {out}, the {network} network of rollout_gradient" in capsys.readouterr().out
    predictor = Predictor.load("rollout_gradient")
    core = predictor.core_policy
    for seed in range(10):
        traffic, _ = random_case("bendplatz", seed)
        seen = predictor.observe(traffic)
        cases: dict[str, tuple[NDArray[np.float32], Callable[[NDArray[np.float32]], NDArray[np.float32]]]] = {
            "gap": (seen.gap, core.evaluate_gap),
            "driving": (seen.driving, lambda rows: np.float32(ACCELERATION) * np.tanh(core.evaluate_driving(rows))),
            "orders": (predictor.bound_to(traffic.intersection).observe_orders(traffic.core), core.evaluate_order),
        }
        features, wanted = cases[network]
        if len(features):
            np.testing.assert_allclose(evaluated(out, features), wanted(features), atol=2e-5)
    assert said_features(out) == NETWORKS[network].features


def evaluated(path: Path, features: NDArray[np.float32]) -> NDArray[np.float32]:
    """What an exported file makes of rows of features."""
    if path.suffix == ".onnx":
        session = onnxruntime.InferenceSession(path)
        (found,) = session.run(None, {"features": features})
        return np.asarray(found)
    with torch.no_grad():
        module = torch.export.load(path).module()
        return np.asarray(module(torch.from_numpy(features)).numpy())


def said_features(path: Path) -> tuple[str, ...]:
    if path.suffix == ".onnx":
        said = onnxruntime.InferenceSession(path).get_modelmeta().custom_metadata_map["features"]
    else:
        files = {"features.json": ""}
        torch.export.load(path, extra_files=files)
        said = files["features.json"]
    return tuple(json.loads(said))


def test_a_network_that_a_policy_lacks_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, message in [
        (["idm_calibrated", "--network", "driving"], "holds no driving network"),
        (["idm", "--network", "gap"], "holds no gap network"),
        (["nope.policy", "--network", "gap"], 'policy "nope.policy": no such file'),
        (["gap", "--network", "gap", "--to", "torch"], "--out must end in .pt2"),
    ]:
        assert main([*arguments, "--out", str(tmp_path / "a.onnx")]) == 1
        assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
