"""Chance in the worlds of both kinds: a seed decides, and neither threads, batches nor instruction sets do."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from intersection_env import _core
from tests.support.recorded_windows import DECISIONS, replayed_windows
from tests.support.world_traces import Worlds, trace
from tests.support.worlds_cases import closed_loop

GAPS = ("critical_gap", "sumo", "network")
EPISODE = 2000  # cycles
Make = Callable[..., Worlds]


def closed(worlds: int, autoreset: str, vehicles: int = 5, max_cycles: int = EPISODE, threads: int = 1) -> Worlds:
    return closed_loop("bendplatz", worlds, vehicles, autoreset=autoreset, max_cycles=max_cycles, threads=threads)


KINDS = {"closed_loop": (closed, EPISODE), "replay": (replayed_windows, 300)}


@pytest.mark.parametrize("autoreset", ["same_step", "next_step"])
@pytest.mark.parametrize(("make", "steps"), KINDS.values(), ids=KINDS)
def test_same_seed_gives_the_same_bytes_over_a_whole_episode(make: Make, steps: int, autoreset: str) -> None:
    """With one thread and with two, in a batch of one world and of forty; and another seed gives others."""
    one_thread, two_threads = (make(40, autoreset=autoreset, threads=threads) for threads in (1, 2))
    one_world = make(1, autoreset=autoreset)
    for worlds in (one_thread, two_threads, one_world):
        worlds.reset(11, False)
    assert trace(one_thread, steps, 2) == trace(two_threads, steps, 2)
    first = slice(0, 1)
    one_thread.reset(11, False)
    given = trace(one_world, steps, 2)
    assert trace(one_thread, steps, 2, first) == given
    one_thread.reset(12, False)
    assert trace(one_thread, steps, 2, first) != given


@pytest.mark.parametrize("world", [0, 15, 16, 39])
@pytest.mark.parametrize("make", [partial(closed, vehicles=6), replayed_windows], ids=KINDS)
def test_a_world_does_not_depend_on_how_many_there_are(make: Make, world: int) -> None:
    few, many = (make(count, autoreset="same_step") for count in (world + 1, 40))
    for worlds in (few, many):
        worlds.reset(12, True)
    chosen = slice(world, world + 1)
    assert trace(few, 200, 3, chosen) == trace(many, 200, 3, chosen)


@pytest.mark.parametrize(
    "make",
    [
        *(pytest.param(partial(closed_loop, "bendplatz", 40, 12, gap=gap), id=f"closed_loop-{gap}") for gap in GAPS),
        *(pytest.param(partial(replayed_windows, 40, decisions=name), id=f"replay-{name}") for name in DECISIONS),
    ],
)
def test_v3_and_v4_give_the_same_bytes(make: Make) -> None:
    if not {"v3", "v4"} <= set(_core.available_kernels()):
        pytest.skip("this machine has no AVX-512: there is nothing to compare")
    traces = []
    for isa in ("v3", "v4"):
        worlds = make(autoreset="same_step", isa=isa)
        worlds.reset(13, True)
        traces.append(trace(worlds, 300, 4))
    assert traces[0] == traces[1]


def test_another_seed_gives_other_worlds() -> None:
    starts = []
    loop = closed_loop("t_junction", 6, 4)
    for seed in (0, 1, 2**40, 2**40 + 1, 0):
        loop.reset(seed, False)
        starts.append(loop.state()["position"])
    flat = np.concatenate([start for start in starts[:4]])
    assert len(np.unique(flat[:, 0])) == len(flat)  # neither are two worlds of one seed alike
    np.testing.assert_array_equal(starts[0], starts[4])
