"""How two routes meet: they conflict, or they share a lane."""

from __future__ import annotations

from typing import NamedTuple

SWEPT_WIDTH = 2.0  # [m], ours: a wide car; two routes conflict where bands this wide overlap
NEVER = 1.0e6  # [m], an arc length that no vehicle reaches


class Conflict(NamedTuple):
    """Route `yielder` gives way to route `prioritized`; intervals of arc length on each [m].

    The yielder is guaranteed to arrive (PGA) once its rear bumper reaches the end of its interval.
    """

    yielder: int
    prioritized: int
    merging: bool
    on_yielder: tuple[float, float]
    on_prioritized: tuple[float, float]


class SharedLane(NamedTuple):
    """Where vehicles of routes a and b follow each other [m].

    Before `split` (same arc length on both) they share a lane from the start; from `merge_a` on a and `merge_b` on b
    on they share one to the end, where position_b = position_a + offset. A stretch that does not exist has split
    -NEVER, or merges at NEVER.
    """

    a: int
    b: int
    split: float
    merge_a: float
    merge_b: float
    offset: float
