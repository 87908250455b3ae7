"""The environments as their users open them: gap rules, actions that do nothing, episodes and their fingerprints."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import ClosedLoop, Replay
from tests.support.episodes import as_bytes, closed_loop_episode, replay_episode

GAPS = ("critical_gap", "sumo", "gap")
REPLAY_GAPS = ("recording", *GAPS)
STILL: NDArray[np.float32] = np.zeros(1, np.float32)
"""The replay's action."""
ALL_STILL = {f"vehicle_{number}": STILL for number in range(12)}
"""The closed loop's, for as many vehicles as it has by default."""


def episode(environment: ClosedLoop | Replay, generator: np.random.Generator, most: int = 10_000) -> list[Any]:
    """All steps until the end, with gentle random actions."""
    run: Any = closed_loop_episode if isinstance(environment, ClosedLoop) else replay_episode
    steps: list[Any] = run(environment, generator, most)
    return steps


def digest(environment: ClosedLoop | Replay, seed: int) -> str:
    """A fingerprint of four episodes from one seed."""
    generator = np.random.default_rng(seed)
    found = [as_bytes(environment.reset(seed=seed))]
    for _ in range(4):
        found += [as_bytes(episode(environment, generator)), as_bytes(environment.reset())]
    return hashlib.sha256(b"".join(found)).hexdigest()
