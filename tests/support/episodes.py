"""Episodes of the environments, and what they gave as bytes."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from intersection_env import ClosedLoop
from intersection_env.envs.closed_loop import Steps

WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "deepcopy": copy.deepcopy,
}


def gentle(environment: ParallelEnv[str, Any, Any], generator: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Small random accelerations, so that episodes last."""
    return {agent: generator.uniform(-0.2, 0.2, 1).astype(np.float32) for agent in environment.possible_agents}


def closed_loop_episode(environment: ClosedLoop, generator: np.random.Generator, most: int = 10_000) -> list[Steps]:
    """All steps until the world's end."""
    steps: list[Steps] = []
    while environment.agents and len(steps) < most:
        steps.append(environment.step(gentle(environment, generator)))
    return steps


def replay_episode(environment: Any, generator: np.random.Generator, most: int = 10_000) -> list[Any]:
    """All steps until the episode's end, with moderate random accelerations."""
    steps: list[Any] = []
    while not (steps and (steps[-1][2] or steps[-1][3])) and len(steps) < most:
        steps.append(environment.step(generator.uniform(-0.4, 0.4, 1).astype(np.float32)))
    return steps


def as_bytes(thing: Any) -> bytes:
    """What a step gives, to the last bit."""
    if isinstance(thing, np.ndarray):
        return repr(thing.tolist()).encode() if thing.dtype == object else thing.tobytes()
    if isinstance(thing, dict):
        return b"".join(key.encode() + as_bytes(value) for key, value in thing.items())
    if isinstance(thing, list | tuple):
        return b"".join(as_bytes(one) for one in thing)
    return repr(thing).encode()
