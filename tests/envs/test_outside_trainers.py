"""Trainers from outside run on the environments as they are: Stable-Baselines3, CleanRL, TorchRL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from torch import nn
from torchrl.data import Composite, Unbounded
from torchrl.envs import GymWrapper, PettingZooWrapper, default_info_dict_reader
from torchrl.envs.utils import check_env_specs

from intersection_env import ClosedLoopWorlds, parallel_env

REPLAY = "intersection_env/Replay-v0"


def test_stable_baselines_takes_the_replay_without_a_warning() -> None:
    check_env(gymnasium.make(REPLAY).unwrapped)


def test_stable_baselines_ppo_learns_on_the_replay() -> None:
    torch.set_num_threads(1)
    model = PPO("MlpPolicy", gymnasium.make(REPLAY), n_steps=512, batch_size=128, n_epochs=2, seed=0, device="cpu")
    before = [parameter.detach().clone() for parameter in model.policy.parameters()]
    model.learn(2048)
    after = list(model.policy.parameters())
    assert all(torch.isfinite(parameter).all() for parameter in after)
    assert any((one != other).any() for one, other in zip(before, after, strict=True))
    assert model.ep_info_buffer, "no episode has ended"


class Agent(nn.Module):
    """CleanRL's continuous actor and critic."""

    def __init__(self) -> None:
        super().__init__()
        self.critic = nn.Sequential(nn.Linear(12, 32), nn.Tanh(), nn.Linear(32, 1))
        self.actor_mean = nn.Sequential(nn.Linear(12, 32), nn.Tanh(), nn.Linear(32, 1))
        self.actor_logstd = nn.Parameter(torch.zeros(1, 1))

    def distribution(self, observation: torch.Tensor) -> Any:
        """Of the action, before it is clipped."""
        return torch.distributions.Normal(self.actor_mean(observation), self.actor_logstd.exp())


@pytest.mark.parametrize("mode", ["vector_entry_point", "sync"])
def test_a_cleanrl_style_ppo_loop_runs_on_the_replay(mode: str) -> None:
    """As in ppo_continuous_action.py, with Gymnasium's wrappers for vectors."""
    torch.manual_seed(0)
    torch.set_num_threads(1)
    steps, worlds, gamma, gae = 32, 8, 0.99, 0.95
    envs = gymnasium.make_vec(REPLAY, num_envs=worlds, vectorization_mode=mode)
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    envs = gymnasium.wrappers.vector.ClipAction(envs)
    envs = gymnasium.wrappers.vector.NormalizeObservation(envs)
    agent = Agent()
    optimizer = torch.optim.Adam(agent.parameters(), lr=3e-4, eps=1e-5)
    observation = torch.as_tensor(envs.reset(seed=1)[0], dtype=torch.float32)
    done, episodes, losses = torch.zeros(worlds), 0, []
    for _ in range(3):
        rows = []
        for _ in range(steps):
            with torch.no_grad():
                distribution = agent.distribution(observation)
                action = distribution.sample()
                value = agent.critic(observation).flatten()
            following, reward, terminated, truncated, infos = envs.step(action.numpy())
            rows.append(
                (observation, action, distribution.log_prob(action).sum(1), value, done, torch.as_tensor(reward))
            )
            observation = torch.as_tensor(following, dtype=torch.float32)
            done = torch.as_tensor(terminated | truncated, dtype=torch.float32)
            episodes += int(infos["_episode"].sum()) if "_episode" in infos else 0
        seen, actions, log_probabilities, values, dones, rewards = (
            torch.stack(column) for column in zip(*rows, strict=True)
        )
        advantages, last = torch.zeros(steps, worlds), torch.zeros(worlds)
        with torch.no_grad():
            value_next, done_next = agent.critic(observation).flatten(), done
        for t in reversed(range(steps)):
            delta = rewards[t].float() + gamma * value_next * (1 - done_next) - values[t]
            advantages[t] = last = delta + gamma * gae * (1 - done_next) * last
            value_next, done_next = values[t], dones[t]
        returns, is_real = (
            (advantages + values).flatten(),
            dones.flatten() == 0,
        )  # next-step autoreset: not after an end
        for indices in np.random.default_rng(0).permutation(steps * worlds).reshape(-1, 64):
            chosen = indices[is_real[indices]]
            own = agent.distribution(seen.flatten(0, 1)[chosen])
            ratio = (own.log_prob(actions.flatten(0, 1)[chosen]).sum(1) - log_probabilities.flatten()[chosen]).exp()
            weight = advantages.flatten()[chosen]
            weight = (weight - weight.mean()) / (weight.std() + 1e-8)
            policy_loss = -torch.min(weight * ratio, weight * ratio.clamp(0.8, 1.2)).mean()
            value_loss = 0.5 * (agent.critic(seen.flatten(0, 1)[chosen]).flatten() - returns[chosen]).square().mean()
            optimizer.zero_grad()
            loss = policy_loss + 0.5 * value_loss
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()
            losses.append(loss.item())
    envs.close()
    assert np.isfinite(losses).all()
    assert episodes > 0


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")  # theirs: they test another version
def test_torchrl_wraps_the_closed_loop() -> None:
    wrapped = PettingZooWrapper(parallel_env(), use_mask=True, done_on_any=False)
    check_env_specs(wrapped)
    rollout = wrapped.rollout(200, break_when_any_done=False)
    assert rollout["vehicle", "observation"].shape[1:] == (12, 12)
    assert rollout["vehicle", "mask"].all(dim=-1).any()


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")  # theirs: they test another version
def test_pettingzoo_wrapper_gives_the_same_specs_and_numbers() -> None:
    wrapped = PettingZooWrapper(parallel_env(vehicles=3, max_cycles=20), use_mask=True, done_on_any=False)
    check_env_specs(wrapped, break_when_any_done="both")
    wrapped.set_seed(3)
    data = wrapped.rollout(50, break_when_any_done=False)
    own = ClosedLoopWorlds(worlds=1, vehicles=3, max_cycles=20)
    own.reset(3)
    own.reset_worlds(np.ones(1, np.bool_))  # `set_seed` resets, and the rollout once more
    ends = data["next", "done"].squeeze(-1).nonzero().flatten().tolist()
    assert len(ends) >= 2
    for step in range(ends[0] + 1):
        np.testing.assert_array_equal(data["vehicle", "observation"][step], own.observation[0])
        own.action[:] = data["vehicle", "action"][step].squeeze(-1).numpy()
        own.step()
        np.testing.assert_array_equal(data["next", "vehicle", "reward"][step].squeeze(-1), own.reward[0])


INFO_TYPES = {
    "expert_observation": torch.float32,
    "expert_acceleration": torch.float32,
    "scene": torch.int64,
    "vehicle": torch.int64,
    "time": torch.float32,
}


def one_replay() -> GymWrapper:
    return GymWrapper(gymnasium.make(REPLAY)).auto_register_info_dict()


def three_replays() -> GymWrapper:
    """In a vector, where TorchRL reads the last observations of episodes too, and wants to be told of other infos."""
    wrapped = GymWrapper(gymnasium.make_vec(REPLAY, num_envs=3, autoreset_mode="SameStep"))
    shapes = {name: (3, 12) if name == "expert_observation" else (3,) for name in INFO_TYPES}
    specs = {name: Unbounded(shapes[name], dtype=dtype) for name, dtype in INFO_TYPES.items()}
    return wrapped.set_info_dict_reader(default_info_dict_reader(list(specs), Composite(specs, shape=(3,))))


@pytest.mark.parametrize("make", [one_replay, three_replays])
def test_torchrl_reads_the_infos_of_the_replay(make: Callable[[], GymWrapper]) -> None:
    wrapped = make()
    check_env_specs(wrapped)
    rollout = wrapped.rollout(30, break_when_any_done=False)
    assert {name: rollout["next", name].dtype for name in INFO_TYPES} == INFO_TYPES
    done = rollout["next", "done"].squeeze(-1)
    going = ~done[..., 1:] & ~done[..., :-1]
    assert going.sum() > 10
    assert torch.allclose(rollout["next", "time"].diff(dim=-1)[going], torch.tensor(0.2), atol=1e-4)


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL:UserWarning")  # theirs: they test another version
def test_torchrl_reads_infos_and_state_of_the_closed_loop() -> None:
    wrapped = PettingZooWrapper(parallel_env(vehicles=3), use_mask=True, done_on_any=False, return_state=True)
    check_env_specs(wrapped)
    wrapped.set_seed(1)
    rollout = wrapped.rollout(400, break_when_any_done=False)
    assert rollout["state"].shape[1:] == (51,)
    assert torch.equal(rollout["state"].unflatten(-1, (3, 17))[..., 5:], rollout["vehicle", "observation"])
    info = rollout["next", "vehicle", "info"]
    left = info["reinserted"].bool()
    assert left.any()
    assert (info["final_observation"][left] != rollout["next", "vehicle", "observation"][left]).any(dim=-1).all()
