"""Environments for TorchRL that end soon, and the advantages of what they give, by a plain sum."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from tensordict import TensorDictBase
from torch import Tensor

from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv

Env = ClosedLoopEnv | ReplayEnv
GAMMA, LAMBDA = 0.99, 0.9


def closed_loop(**arguments: Any) -> ClosedLoopEnv:
    """Eight worlds that end soon."""
    return ClosedLoopEnv(**({"worlds": 8, "max_cycles": 60, "desynchronise": True} | arguments))


def replay(**arguments: Any) -> ReplayEnv:
    return ReplayEnv(**({"worlds": 8, "desynchronise": True} | arguments))


BOTH = pytest.mark.parametrize("make", [closed_loop, replay])


def recursion(data: TensorDictBase) -> Tensor:
    """Advantages (world, step, ...) one step after the other, in float64; every done cuts."""
    value, reward = data["state_value"].double(), data["next", "reward"].double()
    following = data["next", "state_value"].double() * ~data["next", "terminated"]
    advantage, last = torch.zeros_like(value), torch.zeros_like(value[:, 0])
    for step in reversed(range(value.shape[1])):
        delta = reward[:, step] + GAMMA * following[:, step] - value[:, step]
        last = delta + GAMMA * LAMBDA * last * ~data["next", "done"][:, step]
        advantage[:, step] = last
    return advantage
