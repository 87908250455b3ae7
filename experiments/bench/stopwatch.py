"""How often something gets done in a second, over repetitions, and how fast the machine itself is."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence

import numpy as np

Run = Callable[[], tuple[int, float]]
"""One repetition: how many things it did, and in how many seconds."""

REPEATS = 9
PRODUCTS = 200  # some 50 ms, as long as what is timed otherwise


def rate(run: Run, repeats: int = REPEATS) -> dict[str, float]:
    """How many a second over the repetitions: median, least and best; one more before them warms up."""
    run()
    return summary([count / seconds for count, seconds in (run() for _ in range(repeats))])


def summary(rates: Sequence[float]) -> dict[str, float]:
    """Their median, the least and the best of them."""
    return {"median": float(np.median(rates)), "least": min(rates), "best": max(rates)}


def spread(times: Sequence[float]) -> dict[str, float]:
    """The median of times, the most, and the least, which is the best."""
    return {"median": float(np.median(times)), "most": max(times), "best": min(times)}


def timed(work: Callable[[], None], count: int) -> tuple[int, float]:
    """The repetition that does `count` things by this work."""
    begin = time.perf_counter()
    work()
    return count, time.perf_counter() - begin


def core_watch() -> Callable[[], float]:
    """To be asked how much of a core this process got since this call; below 1, others were at work."""
    begin, begin_of_work = time.perf_counter(), time.process_time()
    return lambda: (time.process_time() - begin_of_work) / (time.perf_counter() - begin)


def reference_rate() -> dict[str, float]:
    """How fast this machine is now: a product of 256 x 256 float32 matrices in one thread [GFLOP/s].

    `core_share` is how much of a core this process got meanwhile.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import torch
    torch.set_num_threads(1)
    a, out = torch.ones(256, 256), torch.empty(256, 256)

    def multiply() -> None:
        for _ in range(PRODUCTS):
            torch.mm(a, a, out=out)

    core_share = core_watch()
    found = rate(lambda: timed(multiply, PRODUCTS))
    share = core_share()
    return {name: 2.0 * 256**3 * products / 1e9 for name, products in found.items()} | {"core_share": share}
