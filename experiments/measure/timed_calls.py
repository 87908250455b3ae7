"""What calls take by number of vehicles, timed one by one, and the row of a model in the runtime's results."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

WARM_UP = 5  # calls before each turn that do not count

Times = dict[int, list[float]]
"""By number of vehicles [ms]."""


def milliseconds(calls: Sequence[Callable[[], object]]) -> list[float]:
    """What each call takes [ms], after a few that warm up, without garbage collection."""
    taken = []
    with garbage_kept():
        for call in calls[:WARM_UP]:
            call()
        for call in calls:
            begin = time.perf_counter_ns()
            call()
            taken.append((time.perf_counter_ns() - begin) * 1e-6)
    return taken


@contextmanager
def garbage_kept() -> Iterator[None]:
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def model_row(times: Times, doing: str, scenarios: int = 1) -> dict[str, Any]:
    """What a model did; by number of vehicles the times of one of the scenarios of a call [ms] and how many calls."""
    rows = {
        str(size): {
            "mean": float(np.mean(of)) / scenarios,
            "median": float(np.median(of)) / scenarios,
            "calls": len(of),
        }
        for size, of in times.items()
        if of
    }
    return {"vehicles": rows, "doing": doing}
