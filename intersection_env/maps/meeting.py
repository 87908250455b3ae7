"""How two routes meet: they conflict, or they share a lane."""

from __future__ import annotations

from typing import NamedTuple

SWEPT_WIDTH = 2.0  # [m], ours: a wide car; two routes conflict where bands this wide overlap
NEVER = 1.0e6  # [m], an arc length that no vehicle reaches

Interval = tuple[float, float]
"""From an arc length to another [m]."""


class Conflict(NamedTuple):
    """Route `yielder` gives way to route `prioritized`; intervals of arc length on each [m].

    The yielder is guaranteed to arrive (PGA) once its rear bumper reaches the end of its interval. by_arrival: who
    arrived first at an all-way stop goes first, and the yielder only waits on a tie. line: how far the prioritized
    vehicle still has to go is measured to there, on its route [m].
    """

    yielder: int
    prioritized: int
    merging: bool
    by_arrival: bool
    on_yielder: Interval
    on_prioritized: Interval
    line: float


class SharedLane(NamedTuple):
    """A stretch on which vehicles of routes a and b follow each other [m], position_b = position_a + offset.

    It ends at `end` on a, and so at end + offset on b; at NEVER where it goes on to the end of a route. Where a route
    begins in it, the stretch begins at -NEVER.
    """

    a: int
    b: int
    begin_a: float
    begin_b: float
    end: float
    offset: float


class Overlap(NamedTuple):
    """Where vehicles of two routes can touch: from an arc length to another on each [m]."""

    a: int
    b: int
    begin_a: float
    end_a: float
    begin_b: float
    end_b: float
