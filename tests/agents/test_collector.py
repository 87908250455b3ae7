"""Rollouts in the core and the collector around them, held against steps of the plain worlds."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.modules import IndependentNormal, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from agents.rollouts.collector import RolloutCollector, Rollouts
from agents.rollouts.envs import ClosedLoopEnv
from tests.support.networks import NETWORK_TOLERANCE, driver
from tests.support.torchrl_envs import BOTH, GAMMA, LAMBDA, Env, closed_loop, recursion


def started(make: Callable[..., Env], seed: int = 0, **arguments: Any) -> Env:
    env = make(**arguments)
    env.set_seed(seed)
    env.reset()
    return env


@BOTH
def test_log_probabilities_and_values_of_a_rollout_are_the_networks(make: Callable[..., Env]) -> None:
    env, of = started(make, worlds=40), driver()
    data = Rollouts(env.worlds, 100).collect(of)
    with torch.no_grad():
        latent = torch.distributions.Normal(of.policy(data["observation"]), of.sigma)
        value, last = of.value(data["observation"]), of.value(torch.from_numpy(env.worlds.observation))
    expected = latent.log_prob(data["action"].squeeze(-1))  # type: ignore[no-untyped-call]
    torch.testing.assert_close(data["action_log_prob"], expected, atol=NETWORK_TOLERANCE, rtol=0)
    torch.testing.assert_close(data["state_value"].squeeze(-1), value, atol=NETWORK_TOLERANCE, rtol=0)
    done, following = data["next", "done"], data["next", "state_value"]
    assert done.sum() > 20
    assert data["next", "terminated"].sum() > 2
    assert not (data["next", "terminated"] & ~done).any()
    goes_on = ~done[:, :-1]
    torch.testing.assert_close(following[:, :-1][goes_on], data["state_value"][:, 1:][goes_on], atol=0, rtol=0)
    goes_on = ~done[:, -1]
    torch.testing.assert_close(following[:, -1][goes_on], last.unsqueeze(-1)[goes_on], atol=NETWORK_TOLERANCE, rtol=0)
    score = (data["action"].squeeze(-1) - latent.mean) / latent.stddev
    assert abs(float(score.mean())) < 4 * score.numel() ** -0.5
    assert abs(float(score.std()) - 1) < 4 * (2 * score.numel()) ** -0.5


@BOTH
def test_a_rollout_does_what_steps_with_its_actions_do(make: Callable[..., Env]) -> None:
    env, twin, of = started(make, worlds=40), make(worlds=40).worlds, driver()
    rollouts, cuts = Rollouts(env.worlds, 1), 0
    for _ in range(80):
        twin.set_state(env.state())
        data = rollouts.collect(of)[:, 0]
        np.testing.assert_array_equal(data["observation"], twin.observation)
        twin.action[:] = torch.tanh(data["action"]).squeeze(-1).numpy()
        twin.step()
        cut = twin.terminated | twin.truncated | getattr(twin, "reinserted", False)
        np.testing.assert_array_equal(data["next", "done"].squeeze(-1), cut)
        np.testing.assert_array_equal(data["next", "terminated"].squeeze(-1), twin.terminated)
        np.testing.assert_allclose(data["next", "reward"].squeeze(-1), twin.reward, atol=0.02, rtol=1e-4)
        with torch.no_grad():
            last = of.value(torch.from_numpy(np.where(cut[..., None], twin.final_observation, twin.observation)))
        torch.testing.assert_close(data["next", "state_value"].squeeze(-1), last, atol=1e-4, rtol=0)
        cuts += int(cut.sum())
    assert cuts > 20


@BOTH
def test_gae_of_a_rollout_is_the_recursion_that_every_end_cuts(make: Callable[..., Env]) -> None:
    env = started(make, worlds=20)
    data = Rollouts(env.worlds, 64).collect(driver())
    GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=None)(data)
    expected = recursion(data)
    assert data["next", "done"][:, :-1].sum() > 5
    torch.testing.assert_close(data["advantage"].double(), expected, atol=1e-2, rtol=1e-4)
    target = expected + data["state_value"].double()
    torch.testing.assert_close(data["value_target"].double(), target, atol=1e-2, rtol=1e-4)


@BOTH
def test_a_rollout_feeds_the_ppo_loss(make: Callable[..., Env]) -> None:
    env, of = started(make, worlds=20), driver()
    data = Rollouts(env.worlds, 64).collect(of)
    GAE(gamma=GAMMA, lmbda=LAMBDA, value_network=None)(data)

    class Mean(torch.nn.Module):
        def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
            mean = of.policy(observation).unsqueeze(-1)
            return mean, of.sigma.expand_as(mean)

        policy = of.policy

    actor = ProbabilisticActor(
        TensorDictModule(Mean(), ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        distribution_kwargs={"tanh_loc": False},
        return_log_prob=True,
    )

    class Value(torch.nn.Module):
        value = of.value

        def forward(self, observation: Tensor) -> Tensor:
            value: Tensor = self.value(observation)
            return value.unsqueeze(-1)

    critic = TensorDictModule(Value(), ["observation"], ["state_value"])
    loss = ClipPPOLoss(actor, critic, critic_coeff=0.5, entropy_coeff=0.0, normalize_advantage=True)
    terms = loss(data.reshape(-1))
    assert abs(float(terms["kl_approx"])) < NETWORK_TOLERANCE, "the ratio is not 1 for the policy that acted"
    (terms["loss_objective"] + terms["loss_critic"]).backward()
    assert all((parameter.grad != 0).any() for parameter in loss.parameters())


def test_a_rollout_before_a_reset_is_refused() -> None:
    with pytest.raises(RuntimeError, match="reset"):
        Rollouts(closed_loop().worlds, 4).collect(driver())
    with pytest.raises(ValueError, match="steps"):
        Rollouts(closed_loop().worlds, 0)


# The collector around them


def batches(collector: RolloutCollector) -> list[TensorDictBase]:
    return [batch.clone() for batch in collector]


def collector(
    make: Callable[..., Env] = closed_loop, steps: int = 20, count: int = 4, **others: Any
) -> RolloutCollector:
    env = make()
    torch.manual_seed(5)
    frames = env.worlds.action.size * steps
    return RolloutCollector(env, driver(), frames_per_batch=frames, total_frames=count * frames, **others)


@BOTH
def test_a_seed_decides_what_is_collected(make: Callable[..., Env]) -> None:
    collected = []
    for seed in (1, 1, 2):
        of = collector(make)
        assert isinstance(of.set_seed(seed), int)
        collected.append(batches(of))
    assert len(collected[0]) == len(collector(make)) == 4
    assert all((one == other).all() for one, other in zip(collected[0], collected[1], strict=True))
    assert (collected[0][0]["observation"] != collected[2][0]["observation"]).any()
    assert (collected[0][0]["observation"] != collected[0][1]["observation"]).any()


def test_a_batch_is_valid_until_the_next_but_one() -> None:
    of = iter(collector())
    first = next(of)
    kept = first.clone()
    second = next(of)
    assert (first == kept).all()
    assert first["observation"].data_ptr() != second["observation"].data_ptr()
    assert next(of)["observation"].data_ptr() == first["observation"].data_ptr()


@BOTH
def test_a_collector_goes_on_from_its_state(make: Callable[..., Env]) -> None:
    whole = collector(make)
    whole.set_seed(3)
    steps = iter(whole)
    next(steps)
    state = copy.deepcopy(whole.state_dict())
    rest = [batch.clone() for batch in steps]
    other = collector(make)
    with torch.no_grad():
        other.policy.policy.first.weight.zero_()
    other.load_state_dict(state)
    again = batches(other)
    assert len(rest) == len(again) == 3
    assert all((one == two).all() for one, two in zip(rest, again, strict=True))


def test_a_collector_of_two_environments_collects_what_each_does_one_after_the_other() -> None:
    def both() -> list[ClosedLoopEnv]:
        return [closed_loop(gap="critical_gap"), closed_loop(gap="gap", worlds=4)]

    of, frames = driver(), [count * 12 * 20 for count in (8, 4)]
    together = RolloutCollector(both, of, frames_per_batch=sum(frames), total_frames=-1)
    seed = together.set_seed(3)
    alone = [
        RolloutCollector(env, of, frames_per_batch=n, total_frames=-1) for env, n in zip(both(), frames, strict=True)
    ]
    following = 3
    for one in alone:
        following = one.set_seed(following)
    assert following == seed
    whole, parts = iter(together), [iter(one) for one in alone]
    for _ in range(2):
        assert (next(whole) == torch.cat([next(part) for part in parts])).all()
    state = copy.deepcopy(together.state_dict())
    expected = next(whole).clone()
    next(whole)
    together.load_state_dict(state)
    assert (next(whole) == expected).all()
    assert (next(whole) != expected).any()


def test_a_collector_takes_weights_from_elsewhere() -> None:
    of, elsewhere = collector(), driver()
    of.update_policy_weights_()
    of.update_policy_weights_(elsewhere)
    assert all((one == two).all() for one, two in zip(of.policy.parameters(), elsewhere.parameters(), strict=True))
    third = driver()
    of.update_policy_weights_(TensorDict.from_module(third))
    data = next(iter(of))
    with torch.no_grad():
        value = third.value(data["observation"])
    torch.testing.assert_close(data["state_value"].squeeze(-1), value, atol=NETWORK_TOLERANCE, rtol=0)
    with pytest.raises(KeyError, match="critic"):
        of.update_policy_weights_(third, model_id="critic")


def test_hooks_run_around_each_batch() -> None:
    seen: list[Any] = []
    of = collector(
        pre_collect_hook=lambda: seen.append("before"), post_collect_hook=lambda batch: seen.append(batch.numel())
    )
    batches(of)
    assert seen == ["before", 8 * 12 * 20] * 4
    assert of.stats()["frames"] == of.total_frames


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"frames_per_batch": 100}, ValueError, "multiple of the 96 agents"),
        ({"frames_per_batch": 0}, ValueError, "multiple"),
        ({"total_frames": 0}, ValueError, "total_frames"),
        ({"max_frames_per_traj": 100}, ValueError, "max_frames_per_traj"),
        ({"policy_device": "cuda"}, ValueError, "policy_device"),
        ({"frame_skip": 2}, TypeError, "frame_skip"),
        ({"create_env_fn": lambda: 3}, TypeError, "int"),
        ({"create_env_fn": []}, TypeError, "no environment"),
        (
            {"create_env_fn": [closed_loop, lambda: closed_loop(vehicles=6, worlds=16)], "frames_per_batch": 192},
            ValueError,
            "differ in their vehicles",
        ),
    ],
)
def test_what_a_collector_cannot_do_is_refused(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    valid: dict[str, Any] = {"create_env_fn": [closed_loop], "policy": driver(), "frames_per_batch": 96}
    RolloutCollector(**valid, total_frames=96, max_frames_per_traj=-1, split_trajs=False, device="cpu")
    with pytest.raises(error, match=message):
        RolloutCollector(**(valid | {"total_frames": 96} | arguments))
