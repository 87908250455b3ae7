"""Who is ahead of whom, along the lanes that two tracks share.

As "Lead" of docs/model.md, but where a shared lane begins both fronts must be in it, where the core
asks that of the leader's alone. The core asks whom to follow, also from afar; here it is asked whether
bodies overlap or pass, and arc lengths tell that only where both are in the lane: before the merge two
vehicles may be as far along side by side, each on its own approach. What touches there is found by
`data.pipeline.filters.touchings`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection
from intersection_env.maps.meeting import SharedLane
from intersection_env.scenes.scene import Track


class PairGap(NamedTuple):
    """Steps at which both tracks are in a lane they share, and how far the second's centre is ahead.

    steps: (n,) of the recording; ahead: (n,) [m].
    """

    steps: NDArray[np.int64]
    ahead: NDArray[np.float64]


def overlap_length(first: Track, second: Track) -> float:
    """Centres closer than this mean that bodies overlap [m]."""
    return 0.5 * (first.length + second.length)


def pair_gap(first: Track, second: Track, intersection: Intersection) -> PairGap | None:
    """The gap where both are in a shared lane; None if they are never in one at the same time."""
    begin, end = max(first.start, second.start), min(first.stop, second.stop)
    if begin >= end:
        return None
    a = first.position[begin - first.start : end - first.start].astype(np.float64)
    b = second.position[begin - second.start : end - second.start].astype(np.float64)
    steps = np.arange(begin, end)
    if first.route == second.route:
        return PairGap(steps, b - a)
    shared, ahead = np.zeros(len(steps), np.bool_), np.zeros(len(steps))
    for lane in intersection.shared_lanes:
        if (lane.a, lane.b) == (first.route, second.route):
            both, here = _along(lane, a, first.length, b, second.length)
        elif (lane.b, lane.a) == (first.route, second.route):
            both, behind = _along(lane, b, second.length, a, first.length)
            here = -behind
        else:
            continue
        shared, ahead = shared | both, np.where(both, here, ahead)
    return PairGap(steps[shared], ahead[shared]) if shared.any() else None


def _along(
    lane: SharedLane, a: NDArray[np.float64], length_a: float, b: NDArray[np.float64], length_b: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Whether they share the lane, and how far the one on route b is ahead, per step."""
    there = b - lane.offset
    begun = (a + 0.5 * length_a > lane.begin_a) & (b + 0.5 * length_b > lane.begin_b)
    return begun & (a - 0.5 * length_a < lane.end) & (there - 0.5 * length_b < lane.end), there - a
