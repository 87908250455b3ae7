"""Work that may take its process along, as libsumo does now and then: done in one of its own, and again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeVar

CHUNK = 100  # items that are done again after a crash
TRIES = 3  # of a chunk

Item = TypeVar("Item")
Result = TypeVar("Result")


def surviving(
    work: Callable[[Sequence[Item]], list[Result]], items: Sequence[Item], what: str, chunk: int = CHUNK
) -> list[Result]:
    """What a function that runs SUMO makes of these, one result an item, some at a time in another process.

    Args:
        work: a module's function.
        items: to be pickled.
        what: they are, for the error.
        chunk: items at a time.

    Raises:
        RuntimeError: SUMO crashed again and again at the same place.
    """
    found: list[Result] = []
    crashes = 0
    while len(found) < len(items):
        try:
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                while len(found) < len(items):
                    found += process.submit(work, items[len(found) : len(found) + chunk]).result()
                    crashes = 0
        except BrokenProcessPool:
            crashes += 1
            if crashes == TRIES:
                raise RuntimeError(f"libsumo crashed {TRIES} times at {what} {len(found)} and on") from None
    return found
