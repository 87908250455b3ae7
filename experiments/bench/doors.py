"""Times the doors to the environments, one world or many, and the renderer; a part of `make bench`.

The actions are made before, by the same driving: resets count, choosing an action does not.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import intersection_env
from experiments.bench.drivers import idm_actions
from experiments.bench.stopwatch import Run, rate, timed
from intersection_env.constants import ACCELERATION

Arrays = NDArray[np.float32]
STEPS, VECTOR_WORLDS = 1500, 64
FRAMES = 100


def door_rates() -> list[dict[str, Any]]:
    """A row a door: its name, and agent-steps a second; prints them."""
    runs = {
        "PettingZoo, `parallel_env()`, 12 agents": parallel_env_run(),
        f"`gymnasium.make_vec`, Replay, {VECTOR_WORLDS} worlds": make_vec_run(),
        "`gymnasium.make`, Replay": make_run(),
    }
    rows = []
    for name, run in runs.items():
        found = rate(run)
        print(f"{name}: {found['median'] / 1e3:.0f}k (best {found['best'] / 1e3:.0f}k) agent-steps/s", flush=True)
        rows.append({"name": name, "rate": found})
    return rows


def parallel_env_run(steps: int = STEPS) -> Run:
    """The PettingZoo environment with the IDM's actions, made before; resets count."""
    env = intersection_env.parallel_env()
    made: list[dict[str, Arrays]] = []

    def drive(actions: Iterator[dict[str, Arrays]] | None) -> None:
        observations, _ = env.reset(seed=0)
        for _ in range(steps):
            if actions is None:
                rows = idm_actions(np.stack(list(observations.values())))[:, None]
                made.append(dict(zip(observations, rows, strict=True)))
            observations, *_ = env.step(next(actions) if actions else made[-1])
            if not env.agents:
                observations, _ = env.reset()

    drive(None)
    return lambda: timed(lambda: drive(iter(made)), steps * len(env.possible_agents))


def make_vec_run(steps: int = STEPS) -> Run:
    """`make_vec` with the recorded vehicles' actions, made before."""
    envs = gymnasium.make_vec(
        "intersection_env:intersection_env/Replay-v0", num_envs=VECTOR_WORLDS, vectorization_mode="vector_entry_point"
    )
    made: list[Arrays] = []

    def drive(actions: Iterator[Arrays] | None) -> None:
        _, infos = envs.reset(seed=0)
        for _ in range(steps):
            if actions is None:
                made.append(np.clip(infos["expert_acceleration"] / ACCELERATION, -1, 1).astype(np.float32)[:, None])
            *_, infos = envs.step(next(actions) if actions else made[-1])

    drive(None)
    return lambda: timed(lambda: drive(iter(made)), steps * VECTOR_WORLDS)


def make_run(steps: int = STEPS) -> Run:
    """`make` with the recorded vehicle's actions, made before; resets count."""
    env = gymnasium.make("intersection_env/Replay-v0")
    made: list[Arrays] = []

    def drive(actions: Iterator[Arrays] | None) -> None:
        _, info = env.reset(seed=0)
        for _ in range(steps):
            if actions is None:
                made.append(np.clip([info["expert_acceleration"] / ACCELERATION], -1, 1).astype(np.float32))
            _, _, terminated, truncated, info = env.step(next(actions) if actions else made[-1])
            if terminated or truncated:
                _, info = env.reset()

    drive(None)
    return lambda: timed(lambda: drive(iter(made)), steps)


def frame_milliseconds(frames: int = FRAMES) -> dict[str, float]:
    """How long `render` takes for a picture of 600 x 600 with 12 vehicles: median, least and most."""
    env = intersection_env.parallel_env(render_mode="rgb_array")
    observations, _ = env.reset(seed=0)
    times = []
    for _ in range(frames + 1):
        rows = idm_actions(np.stack(list(observations.values())))[:, None]
        observations, *_ = env.step(dict(zip(observations, rows, strict=True)))
        if not env.agents:
            observations, _ = env.reset()
        begin = time.perf_counter()
        env.render()
        times.append(1e3 * (time.perf_counter() - begin))
    env.close()
    return {"median": float(np.median(times[1:])), "least": min(times[1:]), "most": max(times[1:])}
