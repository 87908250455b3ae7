"""PPO in one file, as CleanRL keeps its algorithms: all that happens stands here, with torch and Gymnasium alone.

pip install . torch
python examples/learning/single_file_ppo.py

It learns in the vector of replays, which the core steps at once. A world whose episode has ended starts anew with the
next step (Gymnasium's next-step autoreset), whose action counts for nothing: such steps are left out.
"""

# /// script
# dependencies = ["intersection_env", "torch"]
# ///

from __future__ import annotations

import argparse
from dataclasses import dataclass

import gymnasium
import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal

ID = "intersection_env:intersection_env/Replay-v0"
WORLDS, STEPS = 64, 128  # of a rollout
GAMMA, TRACE, CLIP = 0.98, 0.95, 0.2
PASSES, MINIBATCHES, LEARNING_RATE = 5, 8, 1e-3
REWARD_SCALE = 0.01  # a collision costs 5000, a step in good order pays 2


class Agent(nn.Module):
    """Actor and critic; observations are brought to [-1, 1] by the bounds of their space."""

    def __init__(self, space: gymnasium.spaces.Box) -> None:
        super().__init__()
        self.register_buffer("largest", torch.from_numpy(np.maximum(np.abs(space.low), np.abs(space.high))))
        self.mean, self.value = self._network(), self._network()
        self.log_deviation = nn.Parameter(torch.full((1,), -1.0))

    @staticmethod
    def _network() -> nn.Sequential:
        return nn.Sequential(nn.Linear(12, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))

    def forward(self, observation: Tensor) -> tuple[Normal, Tensor]:
        """The distribution of the action before it is clipped, (..., 1), and the value (...,)."""
        seen = observation / self.largest
        return Normal(self.mean(seen), self.log_deviation.exp()), self.value(seen).squeeze(-1)


@dataclass
class Rollout:
    """What happened: (step, world) each, observation (step, world, 12), action (step, world, 1)."""

    observation: Tensor
    action: Tensor
    log_probability: Tensor
    value: Tensor
    value_next: Tensor
    reward: Tensor
    terminated: Tensor
    done: Tensor
    counts: Tensor


class Collector:
    """Steps the worlds, and remembers where they are."""

    def __init__(self, worlds: gymnasium.vector.VectorEnv, seed: int) -> None:
        self.worlds = worlds
        self.observation = torch.from_numpy(worlds.reset(seed=seed)[0])
        self.was_done = torch.zeros(worlds.num_envs, dtype=torch.bool)
        self.paid = torch.zeros(worlds.num_envs)
        self.returns: list[float] = []

    @torch.no_grad()
    def collect(self, agent: Agent) -> Rollout:
        """The next steps of all worlds; the returns of episodes that end go to `returns`."""
        rows = []
        for _ in range(STEPS):
            distribution, value = agent(self.observation)
            action = distribution.sample()
            seen, reward, terminated, truncated, _ = self.worlds.step(action.clamp(-1.0, 1.0).numpy())
            following, paid = torch.from_numpy(seen), torch.from_numpy(reward).float()
            ended, done = torch.from_numpy(terminated), torch.from_numpy(terminated | truncated)
            log_probability = distribution.log_prob(action).squeeze(-1)
            _, value_next = agent(following)
            rows.append((self.observation, action, log_probability, value, value_next, REWARD_SCALE * paid))
            rows[-1] += (ended, done, ~self.was_done)
            self.paid += paid
            self.returns += self.paid[done].tolist()
            self.paid[done] = 0.0
            self.observation, self.was_done = following, done
        return Rollout(*(torch.stack(column) for column in zip(*rows, strict=True)))


def advantages(rollout: Rollout) -> Tensor:
    """Generalized advantage estimation (step, world)."""
    error = rollout.reward + GAMMA * rollout.value_next * ~rollout.terminated - rollout.value
    found, last = torch.zeros_like(error), torch.zeros_like(error[0])
    for step in reversed(range(len(error))):
        last = error[step] + GAMMA * TRACE * last * ~rollout.done[step]
        found[step] = last
    return found


def update(agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout) -> None:
    """Passes of clipped updates over the steps that count."""
    advantage = advantages(rollout)
    columns = (rollout.observation, rollout.action, rollout.log_probability, advantage, advantage + rollout.value)
    observation, action, log_probability, advantage, wanted = (column[rollout.counts] for column in columns)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    for _ in range(PASSES):
        for part in torch.randperm(len(advantage)).chunk(MINIBATCHES):
            distribution, value = agent(observation[part])
            ratio = (distribution.log_prob(action[part]).squeeze(-1) - log_probability[part]).exp()
            gain = torch.minimum(ratio * advantage[part], ratio.clamp(1 - CLIP, 1 + CLIP) * advantage[part])
            loss = 0.5 * (value - wanted[part]).square().mean() - gain.mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main() -> None:
    """Trains, and prints the mean return of the episodes that ended in each tenth of the training."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)  # such small networks gain nothing from more
    worlds = gymnasium.make_vec(ID, num_envs=WORLDS)
    agent = Agent(worlds.single_observation_space)
    optimizer = torch.optim.Adam(agent.parameters(), LEARNING_RATE, eps=1e-5)
    collector = Collector(worlds, options.seed)
    for iteration in range(1, options.iterations + 1):
        update(agent, optimizer, collector.collect(agent))
        if iteration % max(1, options.iterations // 10) == 0:
            mean = np.mean(collector.returns)
            print(f"{iteration:3d}: return {mean:9.1f} of {len(collector.returns)} episodes", flush=True)
            collector.returns.clear()


if __name__ == "__main__":
    main()
