#!/usr/bin/env bash
# What supersuit hands to Stable-Baselines3 hides time limits: PPO learns that the world ends there.
#
# Expected: an episode that is truncated, not terminated, is bootstrapped: PPO adds the discounted value of the last
#   observation to the last reward, as it does for the same environment in its own vector environments.
# Version: supersuit 3.11.0 with stable-baselines3 2.9.2, pettingzoo 1.27.0 and torch 2.13.0.
# Happens: the wrapper of concat_vec_envs_v1(..., base_class="stable_baselines3") makes one `done` of both flags and
#   does not set the key "TimeLimit.truncated" that PPO looks for. Every time limit counts as an end without a future,
#   with no warning.
# Instead: set infos[agent]["TimeLimit.truncated"] in the environment's own step where it truncates; supersuit adds the
#   last observation.
# Output (episodes of 4 steps that pay 1 each and are cut off; a value of 10 by construction, gamma 0.5):
# > Stable-Baselines3's own: [1.0, 1.0, 1.0, 6.0]
# > supersuit: [1.0, 1.0, 1.0, 1.0]
# > supersuit, key set by the environment: [1.0, 1.0, 1.0, 6.0]
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check \
  supersuit==3.11.0 stable-baselines3==2.9.2 pettingzoo==1.27.0 torch==2.13.0
venv/bin/python - <<'PYTHON' | tee seen
import gymnasium
import numpy as np
import supersuit
import torch
from pettingzoo import ParallelEnv
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

LIMIT, SEEN, ACTS = 4, gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32), gymnasium.spaces.Discrete(2)


class Alone(gymnasium.Env):
    """Pays 1 a step and is cut off after a few."""

    observation_space, action_space = SEEN, ACTS

    def reset(self, seed=None, options=None):
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.zeros(1, np.float32), 1.0, False, self.steps == LIMIT, {}


class Together(ParallelEnv):
    """The same for one agent of PettingZoo's."""

    metadata, render_mode = {"name": "together"}, None

    def __init__(self, tells):
        self.possible_agents, self.agents, self.tells = ["agent"], [], tells

    def observation_space(self, agent):
        return SEEN

    def action_space(self, agent):
        return ACTS

    def reset(self, seed=None, options=None):
        self.alone, self.agents = Alone(), ["agent"]
        return tuple({"agent": one} for one in self.alone.reset())

    def step(self, actions):
        *results, cut, info = self.alone.step(actions["agent"])
        if cut:
            self.agents = []
        if cut and self.tells:
            info["TimeLimit.truncated"] = True
        return tuple({"agent": one} for one in (*results, cut, info))


def through_supersuit(tells):
    vector = supersuit.pettingzoo_env_to_vec_env_v1(Together(tells))
    return supersuit.concat_vec_envs_v1(vector, 1, num_cpus=0, base_class="stable_baselines3")


for name, worlds in (
    ("Stable-Baselines3's own", DummyVecEnv([Alone])),
    ("supersuit", through_supersuit(tells=False)),
    ("supersuit, key set by the environment", through_supersuit(tells=True)),
):
    model = PPO("MlpPolicy", worlds, n_steps=LIMIT, batch_size=LIMIT, gamma=0.5, device="cpu")
    with torch.no_grad():
        model.policy.value_net.weight.zero_()
        model.policy.value_net.bias.fill_(10.0)
    model.learn(LIMIT)
    print(f"{name}: {model.rollout_buffer.rewards[:, 0].tolist()}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
