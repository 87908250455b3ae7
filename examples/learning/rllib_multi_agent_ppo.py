"""PPO of RLlib in the closed loop: twelve vehicles, each an agent, learn one policy that all of them drive by.

pip install . "ray[rllib]" torch
python examples/learning/rllib_multi_agent_ppo.py

RLlib's wrapper for PettingZoo ends an episode only where all agents are terminated or all are truncated: hence
`ends_together`. Observations and rewards are scaled on the way, as RLlib's networks and its value loss like them.
"""

# /// script
# dependencies = ["intersection_env", "ray[rllib]", "torch"]
# ///

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import numpy as np
from pettingzoo.utils import BaseParallelWrapper
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

from intersection_env import parallel_env

REWARD_SCALE = 0.01  # a collision costs 5000, a step in good order pays 2
STEPS_AN_ITERATION = 1000  # of the world, times twelve agents


class Scaled(BaseParallelWrapper):
    """Observations within [-1, 1] by the bounds of their space, and smaller rewards."""

    def __init__(self, environment: Any) -> None:
        super().__init__(environment)
        space = environment.observation_space(environment.possible_agents[0])
        self._largest = np.maximum(np.abs(space.low), np.abs(space.high))
        self._space = gymnasium.spaces.Box(space.low / self._largest, space.high / self._largest, dtype=np.float32)

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        """The space of what `_scaled` gives."""
        return self._space

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """As of the environment, scaled."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._scaled(observations), infos

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        """As of the environment, scaled."""
        observations, rewards, *ends_and_infos = self.env.step(actions)
        return self._scaled(observations), {one: REWARD_SCALE * paid for one, paid in rewards.items()}, *ends_and_infos

    def _scaled(self, observations: dict[str, Any]) -> dict[str, Any]:
        return {agent: one / self._largest for agent, one in observations.items()}


def make(arguments: dict[str, Any]) -> ParallelPettingZooEnv:
    """The closed loop as RLlib takes it."""
    return ParallelPettingZooEnv(Scaled(parallel_env(ends_together=True, **arguments)))


def configuration(seed: int) -> PPOConfig:
    """PPO with one policy for all vehicles; collects in this process."""
    register_env("closed_loop", make)
    return (
        PPOConfig()
        .environment("closed_loop", env_config={"max_cycles": 500})
        .env_runners(num_env_runners=0)
        .multi_agent(policies={"driver"}, policy_mapping_fn=lambda agent, *_, **__: "driver")
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[32, 32], vf_share_layers=False))
        .training(
            train_batch_size_per_learner=STEPS_AN_ITERATION,
            minibatch_size=1000,
            num_epochs=5,
            lr=1e-3,
            gamma=0.98,
            lambda_=0.95,
            vf_clip_param=float("inf"),
        )
        .debugging(seed=seed)
    )


def main() -> None:
    """Trains, and prints what came of each iteration."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--iterations", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    algorithm = configuration(options.seed).build_algo()
    for iteration in range(1, options.iterations + 1):
        found = algorithm.train()["env_runners"]
        each = np.mean(list(found["agent_episode_returns_mean"].values())) / REWARD_SCALE
        print(f"{iteration:3d}: {found['episode_len_mean']:6.1f} steps, return {each:9.1f} an agent", flush=True)
    algorithm.stop()


if __name__ == "__main__":
    main()
