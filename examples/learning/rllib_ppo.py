"""PPO of RLlib in the replay: one agent among recorded vehicles.

pip install . "ray[rllib]" torch
python examples/learning/rllib_ppo.py

Observations and rewards are scaled on the way, as RLlib's networks and its value loss like them.
"""

# /// script
# dependencies = ["intersection_env", "ray[rllib]", "torch"]
# ///

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
from gymnasium.wrappers import RescaleObservation, TransformReward
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

REWARD_SCALE = 0.01  # a collision costs 5000, a step in good order pays 2
STEPS_AN_ITERATION = 4000


def make(arguments: dict[str, Any]) -> gymnasium.Env[Any, Any]:
    """The replay with observations in [-1, 1] and smaller rewards."""
    environment = gymnasium.make("intersection_env:intersection_env/Replay-v0", **arguments)
    return TransformReward(RescaleObservation(environment, -1.0, 1.0), lambda reward: REWARD_SCALE * reward)


def configuration(seed: int) -> PPOConfig:
    """PPO that collects in this process."""
    register_env("replay", make)
    return (
        PPOConfig()
        .environment("replay", env_config={})
        .env_runners(num_env_runners=0)
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[32, 32], vf_share_layers=False))
        .training(
            train_batch_size_per_learner=STEPS_AN_ITERATION,
            minibatch_size=500,
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
        paid = found["episode_return_mean"] / REWARD_SCALE
        print(f"{iteration:3d}: {found['episode_len_mean']:6.1f} steps, return {paid:9.1f}", flush=True)
    algorithm.stop()


if __name__ == "__main__":
    main()
