"""What the benchmark times is what it says: floors count the networks, peers do the same work, parts run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from experiments.bench import bench, predictor_peers
from experiments.bench import predictor as predictor_bench
from experiments.bench.timed_traffic import COUNTED, arithmetic, both_networks, traffic, traffic_with_orders
from experiments.show.predictor_speed import speed_section
from imitation.torch_model import TorchPredictor
from intersection_env import Predictor, _core


def test_the_floor_counts_both_networks_of_every_step() -> None:
    scene = traffic()
    assert (len(scene), len(scene.conflicts)) == (15, 25)
    gap, driving = 4 * 16 + 16 * 16 + 16, 12 * 16 + 16 * 16 + 16
    assert arithmetic(both_networks(), 15, 25) == (50 * (25 * gap + 15 * driving), 50 * 15 * 33) == (768_000, 24_750)
    assert arithmetic(both_networks(), 15, 0) == (348_000, 24_750)
    peak = {"fmas_per_s": 768e9, "tanhs_per_s": 24.75e9}
    assert predictor_bench.floor(peak, 15, 25) == pytest.approx(2.0)


def test_the_torch_peer_predicts_what_the_core_predicts() -> None:
    """Without intervention, with some priorities assigned and with all."""
    scene, policy = traffic(), both_networks()
    orders = predictor_bench._orders(scene, 64)
    orders[:32, ::3] = 0
    orders[0] = 0
    assignments = _core.complete(scene.intersection.core, scene.core, orders)
    ours = Predictor(policy, "networks").predict(scene, assignments)
    theirs = TorchPredictor.of(scene, policy).predict(torch.from_numpy(assignments))
    np.testing.assert_allclose(theirs.position.numpy(), ours.position[:, -1], atol=1e-3)
    np.testing.assert_allclose(theirs.time_loss.numpy(), ours.time_loss, atol=1e-3)
    assert np.ptp(ours.position[:, -1], axis=0).max() > 1.0  # the orders differ


def test_onnx_networks_are_those_of_the_policy() -> None:
    import onnxruntime

    policy = both_networks()
    core = _core.Policy(policy.text(), "networks")
    assert policy.gap_network is not None
    assert policy.driving_network is not None
    for network, activation, evaluate in (
        (policy.gap_network, "LeakyRelu", core.evaluate_gap),
        (policy.driving_network, "Tanh", core.evaluate_driving),
    ):
        rows = np.random.default_rng(0).normal(0.0, 20.0, (7, len(network.shift))).astype(np.float32)
        session = onnxruntime.InferenceSession(predictor_peers.onnx_model(network, activation))
        (output,) = session.run(None, {"features": rows})
        np.testing.assert_allclose(output[:, 0], evaluate(rows), atol=1e-5)


@pytest.mark.parametrize("wanted", predictor_bench.ORDERS)
def test_scenes_for_ranking_have_about_the_orders_that_are_wanted(wanted: int) -> None:
    scene, orders = traffic_with_orders(wanted)
    assert len(scene) == 15
    assert abs(orders - wanted) <= 0.05 * wanted < COUNTED - wanted


def test_works_take_turns() -> None:
    seen: list[str] = []

    def work(name: str, value: float) -> float:
        seen.append(name)
        return value * len(seen)

    found = predictor_bench.in_turns({"a": lambda: work("a", 1.0), "b": lambda: work("b", 10.0)}, 3)
    assert seen == ["a", "b"] * 3
    assert found == {"a": {"median": 3.0, "most": 5.0, "best": 1.0}, "b": {"median": 40.0, "most": 60.0, "best": 20.0}}


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bench with little to do and no peer."""
    peer = {"a peer": {"us": {"median": 1000.0, "most": 1000.0, "best": 900.0}, "doing": "the same", "core_share": 0.5}}
    monkeypatch.setattr(predictor_bench, "predictor_peer_times", lambda: peer | {"b": {"missing": "not installed"}})
    for name, value in {
        "ROUNDS": 1,
        "SIZES": range(2, 4),
        "SECONDS": 1e-6,
        "LATENCY_CALLS": 1000,
        "FLIPPED": 20,
        "ORDERS": (100,),
    }.items():
        monkeypatch.setattr(predictor_bench, name, value)


@pytest.mark.usefixtures("small")
def test_the_bench_of_the_predictor_fills_the_readmes_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "bench.json"
    out.write_text(json.dumps({"environments": {"kept": 1}, "forecast": None, "floor_us": "old"}))
    monkeypatch.setattr("sys.argv", ["bench", "--part", "predictor", "--quick", "--out", str(out)])
    bench.main()
    results: dict[str, Any] = json.loads(out.read_text())
    assert results["environments"] == {"kept": 1}
    kernels = _core.available_kernels()
    for key in ("floor_us", "assigned_floor_us", "single_us", "batch_us", "assigned_us", "maneuvers_per_cycle"):
        assert list(results[key]) == kernels
    assert results["latency_us"]["networks"]["calls"] == 20
    assert results["ranking_ms"]["100"]["networks"]["best"] > 0.0
    assert results["vehicles_us"][kernels[0]]["2"]["1024"]["best"] > 0.0
    block = speed_section(results)
    row = results["batch_us"][kernels[0]]["networks"]["64"]
    ratio = row["best"] / results["floor_us"][kernels[0]]
    assert f"| 64 | {row['median']:.1f} ({row['best']:.1f}; {ratio:.2f}) |" in block
    ours = results["batch_us"][kernels[-1]]["networks"]["1024"]["best"]
    assert f"| a peer | 1,000 (900) | {900.0 / ours:.1f} | the same |" in block
    assert "| b | not installed | | |" in block
    assert "its peers 50 to 50 %" in block
