#!/usr/bin/env bash
# RLlib's wrapper of PettingZoo does not end an episode in which some agents are terminated and others truncated.
#
# Expected: an episode of PettingZoo is over when no agents are left, and RLlib learns it from "__all__".
# Version: ray 2.60.0 with pettingzoo 1.27.0.
# Happens: "__all__" is true where all of a step's agents are terminated, or all truncated. If one crashes in the step
#   in which the time limit cuts off the other, nobody is left and the episode goes on: it takes one step more, without
#   any action, until "__all__" is true, and then it is both for terminated and for truncated.
# Instead: end all agents in the same way in a last step, or set "__all__" in a wrapper of one's own.
# Output:
# > both terminated, step 3: agents left 0, all terminated True, all truncated False
# > one of each, step 3: agents left 0, all terminated False, all truncated False
# > one of each, step 4: agents left 0, all terminated True, all truncated True
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check 'ray[rllib]==2.60.0' pettingzoo==1.27.0
venv/bin/python - <<'PYTHON' | tee seen
import gymnasium
import numpy as np
from pettingzoo import ParallelEnv
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv

LAST = 3


class Two(ParallelEnv):
    """Ends for both agents in the same step."""

    metadata = {"name": "two"}

    def __init__(self, terminated):
        self.possible_agents, self.agents, self.terminated = ["first", "second"], [], terminated

    def observation_space(self, agent):
        return gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)

    def action_space(self, agent):
        return gymnasium.spaces.Discrete(2)

    def reset(self, seed=None, options=None):
        self.agents, self.steps = list(self.possible_agents), 0
        return {one: np.zeros(1, np.float32) for one in self.agents}, {one: {} for one in self.agents}

    def step(self, actions):
        self.steps += 1
        acting, last = self.agents, self.steps == LAST
        self.agents = [] if last else acting
        return (
            {one: np.zeros(1, np.float32) for one in acting},
            {one: 1.0 for one in acting},
            {one: last and one in self.terminated for one in acting},
            {one: last and one not in self.terminated for one in acting},
            {one: {} for one in acting},
        )


for words, terminated in (("both terminated", ["first", "second"]), ("one of each", ["first"])):
    environment = ParallelPettingZooEnv(Two(terminated))
    environment.reset()
    ends = {"__all__": False}, {"__all__": False}
    for step in range(1, LAST + 2):
        left = environment.par_env.agents
        _, _, *ends, _ = environment.step({one: 0 for one in left})
        if step >= LAST:
            print(
                f"{words}, step {step}: agents left {len(environment.par_env.agents)},"
                f" all terminated {ends[0]['__all__']}, all truncated {ends[1]['__all__']}"
            )
        if any(one["__all__"] for one in ends):
            break
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
