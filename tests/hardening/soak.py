"""Many steps of the worlds with random actions: everything stays finite, on its route and within the spaces.

`python -m tests.hardening.soak` (1e8 agent-steps of the closed loop on both maps, 1e7 of the replay, then 1e7
predictions; `make harden` runs it).
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env import ClosedLoopWorlds, Intersection, Predictor, ReplayWorlds, Scenes, crossing_orders
from intersection_env.envs.spaces import observation_space
from intersection_env.features import Driving
from intersection_env.maps.intersection import Sample

MAPS, GAPS = ("bendplatz", "t_junction"), ("critical_gap", "gap")
WORLDS = 2048
EXTREME = 64
"""Worlds beside them, not counted: in half of them all accelerate as hard as they can, in the others all brake."""
CLOSED_LOOP_STEPS, REPLAY_STEPS, PREDICTIONS = 100_000_000, 10_000_000, 10_000_000
STATE_EVERY = 8  # steps: looking into the state costs more than a step
WARM_UP = 0.2  # of the steps, until memory is to stay as it is
MOST_GROWTH = 4 * 2**20  # [byte], ours: allocators move it back and forth; 3 bytes lost with a world's step are more


class Soak:
    """One kind of worlds, stepped with random actions and looked at after every step."""

    def __init__(self, worlds: ClosedLoopWorlds | ReplayWorlds, fastest: float, seed: int) -> None:
        self.worlds = worlds
        self.is_closed_loop = isinstance(worlds, ClosedLoopWorlds)
        space = observation_space(worlds.intersection, fastest, backing=self.is_closed_loop)
        self.low, self.high = space.low, space.high
        self.length = np.array([route.length for route in worlds.intersection.routes], np.float32)
        self.random = np.random.default_rng(seed)
        worlds.reset(seed, desynchronise=True)
        self.ended = 0

    def step(self) -> None:
        """Steps once with uniformly random actions, but for the extreme worlds."""
        action = self.worlds.action
        self.random.random(out=action, dtype=np.float32)
        action *= 2.0
        action -= 1.0
        action[-EXTREME:] = -1.0
        action[-EXTREME::2] = 1.0
        self.worlds.step()
        self.check_results()

    def check_results(self) -> None:
        """What the step gave: finite and within the spaces."""
        worlds = self.worlds
        self._inside(worlds.observation.reshape(-1, 12), "observation")
        over = worlds.terminated | worlds.truncated
        if isinstance(worlds, ClosedLoopWorlds):
            over |= worlds.reinserted
            self.ended += int(worlds.done.sum())
        else:
            self._inside(worlds.expert_observation, "expert_observation")
            self.ended += int(over.sum())
        last = worlds.final_observation[over]
        if len(last):
            self._inside(last, "final_observation")
        if not np.isfinite(worlds.reward).all():
            raise AssertionError(f"a reward is not finite: world {np.argwhere(~np.isfinite(worlds.reward))[0]}")

    def check_state(self) -> None:
        """Where everybody is: on the route, and not faster than the space says."""
        state = self.worlds.state()
        if isinstance(self.worlds, ClosedLoopWorlds):
            route = state["route"]
        else:
            route = self.worlds.tracks.arrays["track_route"][state["track"]]
        position, speed = state["position"], state["speed"]
        if not ((position >= 0.0) & (position <= self.length[route])).all():
            raise AssertionError(f"off the route: positions from {position.min()} to {position.max()} m")
        if not ((speed >= self.low[Driving.SPEED]) & (speed <= self.high[Driving.SPEED])).all():
            raise AssertionError(f"speeds from {speed.min()} to {speed.max()} m/s")

    def _inside(self, rows: NDArray[np.float32], name: str) -> None:
        least, most = rows.min(axis=0), rows.max(axis=0)
        if not ((least >= self.low) & (most <= self.high)).all():  # also where a NaN is
            raise AssertionError(f"{name} leaves its space: from {least} to {most}, in {self.low} to {self.high}")


def resident() -> int:
    """This process's memory [byte]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def soak(made: Callable[[int], Soak], steps: int, worlds: int, say: str) -> None:
    """Takes this many agent-steps.

    Raises:
        AssertionError: something is not as it should be.
    """
    begin = time.perf_counter()
    one = made(worlds + EXTREME)
    counted = one.worlds.action[:-EXTREME].size
    rounds = -(-steps // counted)
    settled = 0
    for step in range(rounds):
        one.step()
        if step % STATE_EVERY == 0 or step == rounds - 1:
            one.check_state()
        if step == int(WARM_UP * rounds):
            settled = resident()
    grown = resident() - settled
    seconds = time.perf_counter() - begin
    print(
        f"{say}: {rounds * counted:.3g} agent-steps in {seconds:.0f} s, {one.ended} worlds ended, "
        f"memory {grown / 2**20:+.1f} MiB",
        flush=True,
    )
    if grown > MOST_GROWTH:
        raise AssertionError(f"{say}: memory grew by {grown / 2**20:.1f} MiB")


def closed_loop(name: str, gap: str, worlds: int, threads: int, seed: int = 1) -> Soak:
    """The closed loop on a map; nobody starts faster than its highest limit."""
    intersection = Intersection.load(name)
    fastest = max(float(route.samples[:, Sample.V_MAX].max()) for route in intersection.routes)
    return Soak(ClosedLoopWorlds(intersection, worlds=worlds, gap=gap, threads=threads), fastest, seed)


def replay(worlds: int, threads: int) -> Soak:
    """The replay of all scenes that ship."""
    found = ReplayWorlds(split=None, worlds=worlds, threads=threads)
    return Soak(found, found.tracks.fastest, seed=1)


def predict(scenarios: int, batch: int = 1024) -> None:
    """Predicts crossing orders of recorded moments, in batches and a few at a time.

    Raises:
        AssertionError: something is not as it should be.
    """
    begin = time.perf_counter()
    scenes, predictor = Scenes.load("bendplatz"), Predictor.load("idm")
    moments = [scenes.at(scene, 0.2 * (scene.steps // 2)) for scene in scenes]
    done = calls = settled = 0
    while done < scenarios:
        traffic, count = moments[calls % len(moments)], batch if calls % 2 else 1 + calls % 16
        orders = next(crossing_orders(traffic, batch=count))
        predicted = predictor.predict(traffic, orders, trajectories=False)
        if not np.isfinite(predicted.time_loss).all():
            raise AssertionError("a time loss is not finite")
        done, calls = done + len(orders), calls + 1
        if not settled and done > WARM_UP * scenarios:
            settled = resident()
    grown = resident() - settled
    seconds = time.perf_counter() - begin
    print(f"predictions: {done:.3g} scenarios in {seconds:.0f} s, memory {grown / 2**20:+.1f} MiB", flush=True)
    if grown > MOST_GROWTH:
        raise AssertionError(f"predictions: memory grew by {grown / 2**20:.1f} MiB")


def run(closed_loop_steps: int, replay_steps: int, worlds: int = WORLDS, threads: int = 0) -> None:
    """Both maps and both kinds of gap decision, then the replay.

    Raises:
        AssertionError: something is not as it should be.
    """
    share = closed_loop_steps // (len(MAPS) * len(GAPS))
    for seed, (name, gap) in enumerate(product(MAPS, GAPS)):
        made = partial(closed_loop, name, gap, threads=threads, seed=seed)
        soak(made, share, worlds, f"closed loop, {name}, {gap}")
    soak(partial(replay, threads=threads), replay_steps, worlds, "replay")


def main() -> None:
    """Soaks the worlds on all cores."""
    parser = argparse.ArgumentParser(prog="python -m tests.hardening.soak", description=__doc__)
    parser.add_argument("--steps", type=float, default=CLOSED_LOOP_STEPS, help="agent-steps of the closed loop")
    parser.add_argument("--replay-steps", type=float, default=REPLAY_STEPS, help="steps of the replay")
    parser.add_argument("--predictions", type=float, default=PREDICTIONS, help="scenarios predicted")
    options = parser.parse_args()
    run(int(options.steps), int(options.replay_steps))
    predict(int(options.predictions))


if __name__ == "__main__":
    main()
