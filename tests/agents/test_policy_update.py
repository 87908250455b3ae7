"""The update of policy and value: its parts against plain sums."""

from __future__ import annotations

import math
from typing import Any

import torch

from agents.networks.driving import Driver
from agents.rollouts.collector import Rollouts
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from intersection_env import ClosedLoopWorlds
from tests.support.networks import driver, weights
from tests.support.torchrl_envs import GAMMA, LAMBDA, recursion


def worlds(**arguments: Any) -> ClosedLoopWorlds:
    """Worlds that end soon, just begun."""
    made = ClosedLoopWorlds(**({"worlds": 8, "max_cycles": 60} | arguments))
    made.reset(3, desynchronise=True)
    return made


def test_advantages_are_the_recursion_that_reinsertions_cut_normalised() -> None:
    data = Rollouts(worlds(max_cycles=2000), 100).collect(driver())
    done = data["next", "done"].squeeze(-1)
    alone = done & ~done.all(dim=2, keepdim=True)
    assert alone[:, :-1].sum() > 5, "no reinsertion"
    wanted = recursion(data)
    target = (wanted + data["state_value"].double()).reshape(-1, 1)
    wanted = ((wanted - wanted.mean()) / wanted.std()).reshape(-1, 1)
    samples = PolicyUpdate(driver(), UpdateSettings(gamma=GAMMA, trace=LAMBDA)).advantages(data)
    torch.testing.assert_close(samples["advantage"].double(), wanted, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(samples["value_target"].double(), target, atol=1e-2, rtol=1e-4)
    assert (samples["observation"] == data["observation"].reshape(-1, 12)).all()


def update_of(of: Driver, value_only: bool = False, rate: float = 1e-3, **settings: Any) -> dict[str, float]:
    """What an update says of a rollout's samples."""
    data = Rollouts(worlds(), 32).collect(of)
    data["next", "reward"].mul_(0.01)
    update = PolicyUpdate(of, UpdateSettings(**settings))
    return update(update.advantages(data), rate, torch.Generator().manual_seed(0), value_only)


def test_an_update_moves_policy_and_value() -> None:
    of = driver()
    before = weights(of.policy), weights(of.value)
    update_of(of)
    assert weights(of.policy) != before[0]
    assert weights(of.value) != before[1]


def test_an_update_of_the_value_alone_leaves_every_byte_of_the_policy() -> None:
    of = driver()
    before = weights(of.policy), weights(of.value)
    update_of(of, value_only=True)
    assert weights(of.policy) == before[0]
    assert weights(of.value) != before[1]


def test_another_loss_is_added_to_that_of_each_update() -> None:
    of, asked = driver(), 0
    data = Rollouts(worlds(), 32).collect(of)
    update = PolicyUpdate(of, UpdateSettings(passes=2, minibatches=3, largest_kl=math.inf))
    seen = data["observation"].reshape(-1, 12)

    def beside() -> torch.Tensor:
        nonlocal asked
        asked += 1
        loss: torch.Tensor = 1e3 * (of.policy(seen) - 1.0).square().mean()
        return loss

    before = float((of.policy(seen).detach() - 1.0).square().mean())
    update(update.advantages(data), 1e-2, torch.Generator().manual_seed(0), beside=beside)
    assert asked == 6
    assert float((of.policy(seen).detach() - 1.0).square().mean()) < 0.9 * before
    policy = weights(of.policy)
    update(update.advantages(data), 1e-2, torch.Generator().manual_seed(0), value_only=True, beside=beside)
    assert weights(of.policy) == policy
    assert asked == 6


def test_passes_end_at_the_largest_kl() -> None:
    within, beyond = 0.006, 0.05
    seen = {}
    for largest in (-1.0, within, beyond, math.inf):
        torch.manual_seed(0)
        seen[largest] = update_of(driver(), largest_kl=largest, passes=8, minibatches=3)
    assert seen[-1.0]["updates"] == 3
    assert 3 < seen[within]["updates"] < 24
    assert seen[within]["kl"] > within
    assert seen[beyond] == seen[math.inf]
    assert seen[beyond]["updates"] == 24


def test_an_update_favours_what_went_better_than_expected() -> None:
    """Up is good, down is bad: the mean action goes up."""
    of = driver()
    data = Rollouts(worlds(), 32).collect(of)
    with torch.no_grad():
        before = of.policy(data["observation"])
    up = torch.sign(data["action"] - before.unsqueeze(-1))
    samples = data.select("observation", "action", "action_log_prob").reshape(-1)
    samples["advantage"] = up.reshape(-1, 1)
    samples["value_target"] = torch.zeros_like(samples["advantage"])
    PolicyUpdate(of, UpdateSettings())(samples, 1e-3, torch.Generator().manual_seed(0))
    with torch.no_grad():
        assert (of.policy(data["observation"]) - before).mean() > 0.02
