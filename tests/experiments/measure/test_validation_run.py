"""Figures of driving networks in the closed loop, and the spread of their accelerations."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network, driving_policy
from agents.rollouts.validation_run import validation_run
from experiments.measure import validation_run as closed_loop
from experiments.measure.validation_run import Options, closed_loop_results, main, poisson_interval
from experiments.show.validation_run import plot_accelerations
from intersection_env import Predictor
from intersection_env.policies.named import gap_decider


@pytest.fixture(autouse=True)
def _short_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loop, "validation_run", partial(validation_run, steps=60))
    torch.set_num_threads(1)


def predictor(bias: float, path: Path) -> Predictor:
    """Drives by nearly the same acceleration always, 6 m/s² times the tanh of `bias`."""
    network = DrivingNetwork()
    with torch.no_grad():
        network.last.weight.mul_(1e-4)
        network.last.bias.fill_(bias)
    driving_policy(gap_decider("gap"), network, {}).save(path)
    return Predictor.load(path)


@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.39)])
def test_poisson_intervals_are_those_of_the_tables(count: int, low: float, high: float) -> None:
    assert poisson_interval(count) == pytest.approx((low, high), rel=1e-3)


def test_accelerations_are_those_that_the_driver_wants(tmp_path: Path) -> None:
    recorded = np.array([-1.0, 0.0, 0.0, 1.0], np.float32)
    results = closed_loop_results(
        [predictor(0.25, tmp_path / "steady.policy")], {"critical": "critical_gap"}, recorded, worlds=2
    )
    wanted = 6.0 * np.tanh(0.25)
    spread = results["acceleration"]["steady"]
    assert spread["quantiles"] == pytest.approx([wanted] * 7, abs=0.02)
    edges = np.array(results["edges"])
    where = int(np.argmax(spread["histogram"]))
    assert edges[where] <= wanted < edges[where + 1]
    assert results["acceleration"]["recorded"]["quantiles"][3] == 0.0
    run = results["drivers"]["steady"]["critical"]
    assert run["seconds"] == 12.0
    assert run["longer"]["seconds"] == 24.0
    assert (
        run["longer"]["collisions"]["low"]
        <= run["longer"]["collisions"]["value"]
        <= run["longer"]["collisions"]["high"]
    )
    assert len(plot_accelerations(results, {"steady": "Steady"}).axes[0].lines) == 2


def test_a_policy_that_drives_by_a_rule_is_refused() -> None:
    with pytest.raises(ValueError, match='drives by "idm" and holds no driving network'):
        closed_loop_results([Predictor.load("gap")], {"critical": "critical_gap"}, np.zeros(1, np.float32))


def test_driving_network_of_a_policy_is_the_one_exported(tmp_path: Path) -> None:
    network, features = DrivingNetwork(), torch.rand(20, 12)
    driving_policy(gap_decider("gap"), network, {}).save(tmp_path / "a.policy")
    again = driving_network(Predictor.load(tmp_path / "a.policy").policy)
    with torch.no_grad():
        torch.testing.assert_close(again(features), network(features), rtol=0, atol=0)


def test_main_writes_results_and_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenes = Path("intersection_env/scenes/bendplatz.npz")
    path = tmp_path / "made.policy"
    predictor(0.0, path)
    options = Options((scenes,), policies=(str(path),), gaps=("critical_gap",), out=tmp_path, figure=tmp_path / "a.pdf")
    assert main(options) == 0
    assert "made" in capsys.readouterr().out
    results = json.loads((tmp_path / "closed_loop.json").read_text())
    assert set(results["acceleration"]) == {"recorded", "made"}
    assert (tmp_path / "a.pdf").read_bytes()[:4] == b"%PDF"
    assert main(Options((scenes,), policies=("gap",), out=tmp_path)) == 1
    assert "holds no driving network" in capsys.readouterr().err
