"""Ray workers that share a training's worlds give the bytes of one process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import ray
import torch

from agents.networks.driving import Driver, DrivingNetwork
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from agents.rollouts.remote import RemoteRollouts
from agents.rollouts.workers import rollout_collector, shares
from agents.training.folder import CHECKPOINT, state_hash
from agents.training.ray import LOCAL_RAY
from tests.support.networks import driver
from tests.support.scenes import small_scenes
from tests.support.torchrl_envs import Env, closed_loop
from tests.support.trainings import TINY_SHARED as TINY
from tests.support.trainings import outcome, train_alone

WORLDS, STEPS, EPOCHS = 8, 20, 5


def replay(**arguments: Any) -> list[ReplayEnv]:
    return [ReplayEnv(small_scenes("train"), desynchronise=True, **arguments)]


def two_deciders(worlds: int, **arguments: Any) -> list[ClosedLoopEnv]:
    return [closed_loop(worlds=worlds // 2, gap=gap, **arguments) for gap in ("critical_gap", "sumo")]


def two_places(worlds: int, **arguments: Any) -> list[ReplayEnv]:
    """The same scenes twice, as if of two places."""
    return [one for _ in range(2) for one in replay(worlds=worlds // 2, **arguments)]


def collector_of(make: Callable[..., list[Env]], of: Driver, workers: int, **others: Any) -> Any:
    arguments: dict[str, Any] = {"worlds": WORLDS, "steps": STEPS, "epochs": EPOCHS, "seed": 3, "threads": 1}
    return rollout_collector(make, of, workers=workers, **(arguments | others))


def change(of: Driver) -> None:
    with torch.no_grad():
        of.sigma.mul_(0.5)
        of.policy.last.bias.add_(1.0)


@pytest.mark.ray
@pytest.mark.usefixtures("ray_with_two_cores")
@pytest.mark.parametrize("make", [two_deciders, replay, two_places])
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
@pytest.mark.usefixtures("ray_with_two_cores")
def test_training_whose_worker_fails_resumes_to_the_bytes_of_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train_alone(replace(TINY, run=tmp_path / "alone"))
    through = RemoteRollouts.state_dict

    def fail_then(self: RemoteRollouts) -> Any:
        state = through(self)
        ray.kill(self.remote_collectors[1])
        return state

    shared = replace(TINY, run=tmp_path / "shared", workers=2)
    with monkeypatch.context() as patch:
        patch.setattr(RemoteRollouts, "state_dict", fail_then)
        with pytest.raises(OSError, match="a Ray worker failed"):
            train_alone(shared)
    assert torch.load(shared.run / CHECKPOINT)["epoch"] == TINY.checkpoint_every
    ray.shutdown()  # as a training that fails ends its process; here Ray may count the dead worker's core as taken
    ray.init("local", num_cpus=2, **LOCAL_RAY)
    train_alone(replace(shared, resume=True))
    assert outcome(shared.run) == outcome(tmp_path / "alone")


@pytest.mark.ray
@pytest.mark.usefixtures("ray_with_two_cores")
@pytest.mark.parametrize(("workers", "message"), [(3, "divided"), (-1, "divided"), (4, "take 4 cores; Ray has 2")])
def test_workers_that_cannot_be_are_refused(workers: int, message: str) -> None:
    with pytest.raises(ValueError, match=message), collector_of(two_deciders, driver(), workers):
        pass


def test_shares_differ_by_one_where_they_cannot_be_equal() -> None:
    assert shares(256, 3) == [86, 85, 85]
    assert shares(6, 6) == [1] * 6
    for worlds, count in ((5, 6), (5, 0)):
        with pytest.raises(ValueError, match=f"{worlds} worlds cannot be shared by {count}"):
            shares(worlds, count)
