"""Trainings on Ray: workers that share worlds, and seeds side by side, give the bytes of one process."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import ray
import torch

from agents.networks.driving import Driver, DrivingNetwork
from agents.ppo import PpoSettings, main, train_driver
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from agents.rollouts.remote import RemoteRollouts
from agents.rollouts.workers import rollout_collector
from agents.training.folder import CHECKPOINT, RunFolder, decisive, state_hash
from agents.training.ray import LOCAL_RAY
from tests.agents.test_torchrl import Env, closed_loop, driver
from tests.support.training import outcome, small_scenes

TINY = PpoSettings(
    gaps=("critical_gap", "sumo"), worlds=4, vehicles=6, steps=16, epochs=4, checkpoint_every=3, threads=1
)
WORLDS, STEPS, EPOCHS = 8, 20, 5


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


@pytest.fixture(scope="module")
def _ray() -> Iterator[None]:
    ray.init("local", num_cpus=2, **LOCAL_RAY)
    yield
    ray.shutdown()


def replay(**arguments: Any) -> list[ReplayEnv]:
    return [ReplayEnv(small_scenes("train"), desynchronise=True, **arguments)]


def two_deciders(worlds: int, **arguments: Any) -> list[ClosedLoopEnv]:
    return [closed_loop(worlds=worlds // 2, gap=gap, **arguments) for gap in ("critical_gap", "sumo")]


def collector_of(make: Callable[..., list[Env]], of: Driver, workers: int, **others: Any) -> Any:
    arguments: dict[str, Any] = {"worlds": WORLDS, "steps": STEPS, "epochs": EPOCHS, "seed": 3, "threads": 1}
    return rollout_collector(make, of, workers=workers, **(arguments | others))


def train(settings: PpoSettings) -> None:
    """What `main` does before the runs of 2000 s."""
    folder = RunFolder.begin(settings.run, decisive(settings), "", settings.resume)
    train_driver(settings, folder, progress=False)


def change(of: Driver) -> None:
    with torch.no_grad():
        of.sigma.mul_(0.5)
        of.policy.last.bias.add_(1.0)


@pytest.mark.ray
@pytest.mark.usefixtures("_ray")
@pytest.mark.parametrize("make", [two_deciders, replay])
def test_workers_collect_what_one_collector_does(make: Callable[..., list[Env]]) -> None:
    of = driver()
    twin = Driver(DrivingNetwork(), DrivingNetwork(), 0.3)
    twin.load_state_dict(of.state_dict())
    with collector_of(make, of, 2) as shared, collector_of(make, twin, 0) as alone:
        batches, expected = iter(shared), iter(alone)
        for _ in range(3):
            batch, wanted = next(batches), next(expected)
            assert batch.shape[:2] == (WORLDS, STEPS)
            assert batch.names == wanted.names
            assert (batch == wanted).all(), "other worlds, or weights that have not arrived"
            assert (batch["observation"][: WORLDS // 2] != batch["observation"][WORLDS // 2 :]).any()
            change(of)
            change(twin)
            shared.update_policy_weights_()
            alone.update_policy_weights_()
        state = shared.state_dict()
        assert state_hash(state) == state_hash(alone.state_dict())
        rest = [batch.clone() for batch in expected]
        next(batches)
        change(of)
        shared.load_state_dict(state)
        assert len(rest) == EPOCHS - 3
        assert all((one == wanted).all() for one, wanted in zip(batches, rest, strict=True))


@pytest.mark.ray
@pytest.mark.usefixtures("_ray")
def test_training_whose_worker_fails_resumes_to_the_bytes_of_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train(replace(TINY, run=tmp_path / "alone"))
    through = RemoteRollouts.state_dict

    def fail_then(self: RemoteRollouts) -> Any:
        state = through(self)
        ray.kill(self.remote_collectors[1])
        return state

    shared = replace(TINY, run=tmp_path / "shared", workers=2)
    with monkeypatch.context() as patch:
        patch.setattr(RemoteRollouts, "state_dict", fail_then)
        with pytest.raises(OSError, match="a Ray worker failed"):
            train(shared)
    assert torch.load(shared.run / CHECKPOINT)["epoch"] == TINY.checkpoint_every
    ray.shutdown()  # as a training that fails ends its process; here Ray may count the dead worker's core as taken
    ray.init("local", num_cpus=2, **LOCAL_RAY)
    train(replace(shared, resume=True))
    assert outcome(shared.run) == outcome(tmp_path / "alone")


@pytest.mark.ray
@pytest.mark.usefixtures("_ray")
def test_seeds_side_by_side_do_what_each_does_alone_and_one_may_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "seed_7").mkdir(parents=True)
    (tmp_path / "runs" / "seed_7" / "config.json").write_text("{}")
    assert main(replace(TINY, run=Path("runs"), seeds=(7, 1, 2))) == 1
    printed = capsys.readouterr()
    assert "seed 7: error:" in printed.err
    assert "holds a run already" in printed.err
    for seed in (1, 2):
        assert f"seed {seed}: 2000 s" in printed.out
        assert (tmp_path / "runs" / f"seed_{seed}" / "ppo.policy").exists()
        train(replace(TINY, run=tmp_path / f"alone_{seed}", seed=seed))
        assert outcome(tmp_path / "runs" / f"seed_{seed}") == outcome(tmp_path / f"alone_{seed}")


@pytest.mark.ray
@pytest.mark.usefixtures("_ray")
@pytest.mark.parametrize(("workers", "message"), [(3, "divided"), (-1, "divided"), (4, "take 4 cores; Ray has 2")])
def test_workers_that_cannot_be_are_refused(workers: int, message: str) -> None:
    with pytest.raises(ValueError, match=message), collector_of(two_deciders, driver(), workers):
        pass


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"workers": 2}, "workers needs Ray, which is not installed: pip install -e '.[ray]'"),
        ({"seeds": (1, 2)}, "seeds needs Ray, which is not installed: pip install -e '.[ray]'"),
        ({"seeds": (1, 2), "workers": 2}, "--seeds and --workers do not go together"),
        ({"workers": 3}, "2 worlds can be divided"),
    ],
)
def test_what_cannot_be_had_without_ray_is_said(
    asked: dict[str, Any],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)  # as if it were not installed
    assert main(replace(TINY, run=tmp_path, **asked)) == 1
    assert message in capsys.readouterr().err
