"""PPO of Stable-Baselines3 in the replay: one agent among recorded vehicles, in several worlds side by side.

pip install . stable-baselines3
python examples/learning/sb3_ppo.py
"""

# /// script
# dependencies = ["intersection_env", "stable-baselines3"]
# ///

from __future__ import annotations

import argparse

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecNormalize

ID = "intersection_env:intersection_env/Replay-v0"
EPISODES = 100  # of a measurement


def measured(model: PPO, worlds: VecNormalize, seed: int) -> float:
    """The mean return of the policy's mean action in episodes that it does not learn from."""
    environment = make_vec_env(lambda: gymnasium.make(ID), n_envs=1, seed=seed)
    normalized = VecNormalize(environment, training=False, norm_reward=False)
    normalized.obs_rms = worlds.obs_rms
    returns, _ = evaluate_policy(model, normalized, n_eval_episodes=EPISODES)
    return float(np.mean(returns))


def main() -> None:
    """Trains, and prints the mean return before and after."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.set_num_threads(1)  # such small networks gain nothing from more
    worlds = VecNormalize(make_vec_env(lambda: gymnasium.make(ID), n_envs=8, seed=options.seed), gamma=0.98)
    model = PPO("MlpPolicy", worlds, gamma=0.98, n_steps=512, batch_size=512, seed=options.seed, device="cpu")
    print(f"before: return {measured(model, worlds, options.seed + 1):9.1f} an episode", flush=True)
    model.learn(options.steps)
    print(f"after:  return {measured(model, worlds, options.seed + 1):9.1f} an episode")


if __name__ == "__main__":
    main()
