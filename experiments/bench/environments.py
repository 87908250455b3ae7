"""Times the environments: agent-steps a second of the batched worlds, then the doors, the renderer and the peers.

A part of `make bench`. Traffic is realistic, as actions come from a driver (`drivers.py`), outside the timed part
unless said otherwise; how often worlds ended stands beside each rate, since a start costs many steps.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.bench.doors import door_rates, frame_milliseconds
from experiments.bench.drivers import fitted_network, idm_actions
from experiments.bench.environment_peers import peer_rates
from experiments.bench.stopwatch import Run, rate, reference_rate
from experiments.bench.threads import thread_rates
from intersection_env import ClosedLoopWorlds, ReplayWorlds, _core
from intersection_env.constants import ACCELERATION

Arrays = NDArray[np.float32]
Worlds = ClosedLoopWorlds | ReplayWorlds
CLOSED_LOOP_WORLDS, VEHICLES = 1024, 12
REPLAY_WORLDS = (64, 1024)
WARM_UP = 150  # steps, until traffic no longer remembers how the worlds started
ROLLOUT_STEPS = 32
SIGMA = 0.1  # of the sampled actions, before their tanh
STEP_ROWS = {
    "closed loop, 1024 worlds, gap by rule; IDM's actions": ("critical_gap", "idm"),
    "the same; uniformly random actions": ("critical_gap", "random"),
}


def environment_rates() -> dict[str, Any]:
    """Everything, as the results file holds it; prints it on the way."""
    reference = [reference_rate()]
    print(f"\n{'agent-steps/s [million]: median (best)':76}" + "".join(f"{name:>18}" for name in columns()))
    network = fitted_network()
    worlds = [_row(name, rates, ends) for name, (rates, ends) in _timed_worlds(network)]
    threads = thread_rates()
    doors = door_rates()
    frame = frame_milliseconds()
    print(f"a frame of 600 x 600: {frame['median']:.2f} ms")
    reference.append(reference_rate())
    peers = peer_rates()
    reference.append(reference_rate())
    for found in reference:
        print(f"float32 matrix product, one thread: {found['median']:.0f} GFLOP/s (best {found['best']:.0f})", end="")
        print(f", with {100 * found['core_share']:.0f} % of a core")
    machine = {"cores": os.cpu_count(), "reference_gflops": reference}
    return machine | {"worlds": worlds, "threads": threads, "doors": doors, "frame_ms": frame, "peers": peers}


def columns() -> dict[str, tuple[str | None, int]]:
    """What each row of the worlds' table is timed with: kernel and threads."""
    kernels: dict[str, tuple[str | None, int]] = {name: (name, 1) for name in _core.available_kernels()}
    best = _core.available_kernels()[-1]
    return kernels | {f"{best}, {os.cpu_count()} cores": (best, 0)}


def _timed_worlds(network: Arrays) -> Iterator[tuple[str, tuple[dict[str, dict[str, float]], float]]]:
    inside = "gap, policy and value networks and sampling inside"
    for name, (gap, driver) in STEP_ROWS.items():
        yield name, _in_columns(partial(_closed_loop, gap), partial(step_run, driver=driver))
    yield (
        f"closed loop, 1024 worlds; {inside}",
        _in_columns(partial(_closed_loop, "gap"), partial(rollout_run, network=network)),
    )
    for count in REPLAY_WORLDS:
        yield (
            f"replay, {count} worlds, recorded gaps; the recorded vehicle's actions",
            _in_columns(partial(_replay, "recording", count), partial(step_run, driver="expert")),
        )
        yield (
            f"replay, {count} worlds; {inside}",
            _in_columns(partial(_replay, "gap", count), partial(rollout_run, network=network)),
        )


def _in_columns(
    made: Callable[[str | None, int], Worlds], prepared: Callable[[Worlds], tuple[Run, float]]
) -> tuple[dict[str, dict[str, float]], float]:
    """Rates of every column, and the share of worlds that end with a step (the best kernel's)."""
    rates, ends = {}, 0.0
    for column, (isa, threads) in columns().items():
        run, ends = prepared(made(isa, threads))
        rates[column] = rate(run)
    return rates, ends


def _closed_loop(gap: str, isa: str | None, threads: int) -> ClosedLoopWorlds:
    return ClosedLoopWorlds(worlds=CLOSED_LOOP_WORLDS, vehicles=VEHICLES, gap=gap, threads=threads, isa=isa)


def _replay(gap: str, worlds: int, isa: str | None, threads: int) -> ReplayWorlds:
    return ReplayWorlds(worlds=worlds, gap=gap, threads=threads, isa=isa)


def step_run(worlds: Worlds, driver: str) -> tuple[Run, float]:
    """Steps with actions that were made before, always the same ones from the same state on.

    driver: "idm", "random" or "expert", the recorded vehicle.
    """
    generator = np.random.default_rng(0)
    worlds.reset(0, desynchronise=True)
    steps = max(50, min(2000, 30_000 // len(worlds.action)))
    actions: list[Arrays] = []
    ended = 0
    for step in range(WARM_UP + steps):
        if step == WARM_UP:
            state = worlds.state()
        worlds.action[:] = _driven(worlds, driver, generator)
        if step >= WARM_UP:
            actions.append(worlds.action.copy())
        worlds.step()
        ended += step >= WARM_UP and int(_ended(worlds).sum())

    def run() -> tuple[int, float]:
        worlds.set_state(state)
        begin = time.perf_counter()
        for action in actions:
            worlds.action[:] = action
            worlds.step()
        return steps * worlds.action.size, time.perf_counter() - begin

    return run, ended / steps / len(worlds.action)


def _driven(worlds: Worlds, driver: str, generator: np.random.Generator) -> Arrays:
    if driver == "random":
        return generator.uniform(-1.0, 1.0, worlds.action.shape).astype(np.float32)
    if driver == "idm":
        return idm_actions(worlds.observation)
    assert isinstance(worlds, ReplayWorlds)
    return np.asarray(np.clip(worlds.expert_acceleration / ACCELERATION, -1.0, 1.0), np.float32)


def _ended(worlds: Worlds) -> NDArray[np.bool_]:
    return worlds.done if isinstance(worlds, ClosedLoopWorlds) else worlds.terminated | worlds.truncated


def rollout_run(worlds: Worlds, network: Arrays) -> tuple[Run, float]:
    """Whole rollouts; the value network is as large as the policy's, and as slow whatever its weights."""
    count, *vehicles = worlds.action.shape
    shape = (count, ROLLOUT_STEPS, *vehicles)
    observation = np.zeros((*shape, 12), np.float32)
    latent, log_probability, value_now, value_next, reward = (np.zeros(shape, np.float32) for _ in range(5))
    terminated, cut = (np.zeros(shape, np.bool_) for _ in range(2))
    value = (0.1 * np.random.default_rng(0).normal(size=network.shape)).astype(np.float32)
    worlds.reset(0, desynchronise=True)
    repeats = max(1, 16_384 // terminated.size)

    def run() -> tuple[int, float]:
        begin = time.perf_counter()
        for _ in range(repeats):
            worlds.core.rollout(
                network,
                value,
                SIGMA,
                ROLLOUT_STEPS,
                observation,
                latent,
                log_probability,
                value_now,
                value_next,
                reward,
                terminated,
                cut,
            )
        return repeats * terminated.size, time.perf_counter() - begin

    ends = []
    for step in range(0, 2 * WARM_UP, ROLLOUT_STEPS):
        run()
        if step >= WARM_UP:
            ends.append(cut.reshape(count, ROLLOUT_STEPS, -1).all(axis=2).mean())
    return run, float(np.mean(ends))


def _row(name: str, rates: dict[str, dict[str, float]], ends: float) -> dict[str, Any]:
    cells = "".join(f"{one['median'] / 1e6:10.1f} ({one['best'] / 1e6:5.1f})" for one in rates.values())
    print(f"{name:76}{cells}   ends a world-step: {100 * ends:.2f} %", flush=True)
    return {"name": name, "rates": rates, "ends_per_world_step": ends}
