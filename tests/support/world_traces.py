"""Batched worlds of either kind driven at random, and what comes out of them as bytes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from tests.support.worlds_cases import OUTPUTS as CLOSED_LOOP_OUTPUTS
from tests.support.worlds_cases import Arrays

Worlds = _core.ClosedLoop | _core.Replay
REPLAY_OUTPUTS = ("observation", "expert_observation", "expert_acceleration", "reward", "terminated", "truncated")


def act(worlds: Worlds, generator: np.random.Generator, spread: float = 1.0) -> None:
    """One step with random actions, float32."""
    worlds.action[:] = np.clip(generator.normal(0.0, spread, worlds.action.shape), -1, 1).astype(np.float32)
    worlds.step()


def outputs(worlds: Worlds) -> Arrays:
    """What the last step gave."""
    names = CLOSED_LOOP_OUTPUTS if isinstance(worlds, _core.ClosedLoop) else REPLAY_OUTPUTS
    return {name: getattr(worlds, name).copy() for name in names}


def bytes_of(arrays: Arrays) -> bytes:
    return b"".join(arrays[name].tobytes() for name in sorted(arrays))


def over(worlds: Worlds) -> NDArray[np.bool_]:
    """Whose final observation counts."""
    flags = worlds.terminated | worlds.truncated
    return flags | worlds.reinserted if isinstance(worlds, _core.ClosedLoop) else flags


def trace(worlds: Worlds, steps: int, seed: int, chosen: slice = slice(None), count: int = 40) -> bytes:
    """Everything that comes out of the chosen worlds over random actions, which are those of `count` worlds."""
    generator = np.random.default_rng(seed)
    is_closed_loop = isinstance(worlds, _core.ClosedLoop)
    extra = () if is_closed_loop else ("track", "time")
    parts = []
    for _ in range(steps):
        actions = generator.uniform(-1, 1, (count, *worlds.action.shape[1:]))
        if is_closed_loop:
            actions *= generator.choice([0.1, 0.4, 1.0])  # so that some live for long
        worlds.action[:] = actions[: len(worlds.action)].astype(np.float32)
        worlds.step()
        given = outputs(worlds) | {name: getattr(worlds, name) for name in extra}
        parts += [values[chosen].tobytes() for name, values in given.items() if name != "final_observation"]
        parts.append(worlds.final_observation[chosen][over(worlds)[chosen]].tobytes())
    state = worlds.state()
    return b"".join([*parts, *(state[name][chosen].tobytes() for name in sorted(state))])
