"""Gaps in prioritized traffic: which were offered to whom, who took them, and the critical gap.

A *gap* is offered to a vehicle that must yield, once it is at its stop line and the prioritized
vehicles that it let pass are clear: the time until the next one reaches their conflict. It is accepted
if the yielder reaches the conflict first. *Unled*: no vehicle ahead that would hold the yielder up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.pipeline.shared_lanes import overlap_length, pair_gap
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.meeting import Conflict
from intersection_env.scenes.scene import Scene, Track

AT_LINE = 2.0  # [m], ours: a front bumper this close to the stop line is at it
LONGEST_GAP = 10.0  # [s], ours: nearly everybody accepts a longer one, so it tells nothing
LED_WITHIN = 10.0  # [m], ours: bumper to bumper; a lead this near holds the yielder up, not the gap

Floats = NDArray[np.float64]


class Gap(NamedTuple):
    """One gap offered to an unled yielder."""

    scene: str
    yielder: str
    prioritized: str
    seconds: float
    accepted: bool


class Pair(NamedTuple):
    """An unled yielder at its line and a prioritized vehicle, and who reached their conflict first."""

    scene: str
    yielder: str
    prioritized: str
    yielder_first: bool


def offered_gaps(scene: Scene, intersection: Intersection) -> Iterator[Gap]:
    """The gaps offered to unled yielders of a scene, at most 10 s long."""
    by_routes = {(conflict.yielder, conflict.prioritized): conflict for conflict in intersection.conflicts}
    for yielder in scene.tracks:
        waiting_since = _at_line(yielder, intersection)
        if waiting_since is None:
            continue
        for arrival, track, conflict in _arrivals(scene, yielder, by_routes, waiting_since):
            entry = _when(yielder, conflict.on_yielder[0] - 0.5 * yielder.length)
            accepted = entry is not None and entry < arrival
            seconds = arrival - waiting_since
            if 0.0 < seconds <= LONGEST_GAP and not _is_led(scene, yielder, waiting_since, intersection):
                yield Gap(scene.id, yielder.id, track.id, seconds, accepted)
            if accepted:
                break
            clear = _when(track, conflict.on_prioritized[1])
            waiting_since = max(waiting_since, arrival if clear is None else clear)


def open_pairs(scene: Scene, intersection: Intersection) -> Iterator[Pair]:
    """The pairs of a scene whose order the unled yielder decided.

    The prioritized vehicle reaches the conflict while the yielder is at its line, or at most 10 s after
    the yielder does.
    """
    by_routes = {(conflict.yielder, conflict.prioritized): conflict for conflict in intersection.conflicts}
    for yielder in scene.tracks:
        at_line = _at_line(yielder, intersection)
        if at_line is None or _is_led(scene, yielder, at_line, intersection):
            continue
        for arrival, track, conflict in _arrivals(scene, yielder, by_routes, at_line):
            entry = _when(yielder, conflict.on_yielder[0] - 0.5 * yielder.length)
            waits = entry is None and arrival <= DT * (yielder.stop - 1)
            if waits or (entry is not None and arrival <= entry + LONGEST_GAP):
                yield Pair(scene.id, yielder.id, track.id, entry is not None and entry < arrival)


def critical_gap(seconds: Floats, accepted: Floats) -> tuple[float, float] | None:
    """The gap that half of all accept, and the width from 10 to 90 % acceptance, by logistic regression [s].

    seconds: (gap,) [s]; accepted: (gap,) 0 or 1. None without a tendency to accept longer gaps.
    """
    if len(seconds) < 10 or accepted.min() == accepted.max():
        return None
    inputs = np.stack([np.ones_like(seconds), seconds], axis=1)
    weights = np.zeros(2)
    ridge = 1e-6 * np.eye(2)  # keeps separable data finite
    for _ in range(50):
        share = 1.0 / (1.0 + np.exp(-np.clip(inputs @ weights, -30.0, 30.0)))
        curvature = (inputs * (share * (1.0 - share))[:, None]).T @ inputs + ridge
        step = np.linalg.solve(curvature, inputs.T @ (accepted - share) - ridge @ weights)
        weights += step
        if np.abs(step).max() < 1e-9:
            break
    if weights[1] <= 0.0:
        return None
    return float(-weights[0] / weights[1]), float(2.0 * np.log(9.0) / weights[1])


def _at_line(yielder: Track, intersection: Intersection) -> float | None:
    return _when(yielder, intersection.routes[yielder.route].stop_line - AT_LINE - 0.5 * yielder.length)


def _arrivals(
    scene: Scene, yielder: Track, by_routes: dict[tuple[int, int], Conflict], after: float
) -> list[tuple[float, Track, Conflict]]:
    """When each foe's front reaches its conflict with the yielder, those after a moment, in order."""
    found: list[tuple[float, Track, Conflict]] = []
    for track in scene.tracks:
        conflict = by_routes.get((yielder.route, track.route))
        if conflict is not None:
            time = _when(track, conflict.on_prioritized[0] - 0.5 * track.length)
            if time is not None and time > after:
                found.append((time, track, conflict))
    return sorted(found, key=lambda one: one[0])


def _when(track: Track, position: float) -> float | None:
    """When the track's centre reaches a position, from the scene's start [s]; None if not seen doing so."""
    if not track.position[0] < position <= track.position[-1]:
        return None
    after = int(np.searchsorted(track.position, position))
    before, beyond = float(track.position[after - 1]), float(track.position[after])
    return DT * (track.start + after - 1 + (position - before) / (beyond - before))


def _is_led(scene: Scene, yielder: Track, time: float, intersection: Intersection) -> bool:
    step = round(time / DT)
    for other in scene.tracks:
        if other is not yielder and other.start <= step < other.stop:
            gap = pair_gap(yielder, other, intersection)
            ahead = gap.ahead[gap.steps == step] if gap is not None else np.zeros(0)
            if len(ahead) and 0.0 < ahead[0] < LED_WITHIN + overlap_length(yielder, other):
                return True
    return False
