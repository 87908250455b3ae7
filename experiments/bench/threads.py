"""Times batched worlds with two threads beside one, in turns: more threads must not be slower, however little there is.

python -m experiments.bench.threads

A part of `make bench`. Two cores have to be free for it to say anything.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from intersection_env import ClosedLoopWorlds, ReplayWorlds
from intersection_env.command import run_command

REPLAYS = (16, 64, 256, 1024)  # worlds, with recorded gaps
CLOSED_LOOPS = ((1, 12), (16, 4), (16, 12), (64, 4), (64, 12), (1024, 12))  # worlds, vehicles in each
PAIRS, SECONDS = 15, 0.02  # of timings; of one timing, at least


def thread_rates() -> list[dict[str, Any]]:
    """The rate with two threads over that with one: median, least and most of pairs; prints it on the way."""
    print(f"\n{'rate with two threads, over that with one':56}{'median':>8}{'least':>8}{'most':>8}")
    rows = [_row(f"replay, {worlds} worlds, recorded gaps", _replay(worlds)) for worlds in REPLAYS]
    for worlds, vehicles in CLOSED_LOOPS:
        rows.append(_row(f"closed loop, {worlds} worlds, {vehicles} vehicles", _closed_loop(worlds, vehicles)))
    return rows


def _replay(worlds: int) -> Callable[[int], ReplayWorlds]:
    return lambda threads: ReplayWorlds(worlds=worlds, threads=threads)


def _closed_loop(worlds: int, vehicles: int) -> Callable[[int], ClosedLoopWorlds]:
    return lambda threads: ClosedLoopWorlds(worlds=worlds, vehicles=vehicles, threads=threads)


def _row(name: str, made: Callable[[int], ReplayWorlds | ClosedLoopWorlds]) -> dict[str, Any]:
    one, two = made(1), made(2)
    for worlds in (one, two):
        worlds.reset(0, desynchronise=True)
        _rate(worlds)
    pairs = np.array([(_rate(one), _rate(two)) for _ in range(PAIRS)])
    ratio = pairs[:, 1] / pairs[:, 0]
    found = {"median": float(np.median(ratio)), "least": float(ratio.min()), "most": float(ratio.max())}
    print(f"{name:56}" + "".join(f"{value:8.2f}" for value in found.values()), flush=True)
    return {"name": name, **found}


def _rate(worlds: ReplayWorlds | ClosedLoopWorlds) -> float:
    """Steps a second, by standing actions."""
    steps, begin = 0, time.perf_counter()
    while (seconds := time.perf_counter() - begin) < SECONDS:
        worlds.step()
        steps += 1
    return steps / seconds


def main() -> None:
    """Times the grid, and prints it."""
    thread_rates()


if __name__ == "__main__":
    run_command(main)
