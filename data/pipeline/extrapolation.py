"""Extends tracks into the past: where a vehicle was before it entered the field of view.

The field of view ends some 2.5 s before the junction, less than the gap that a driver looks for.
Source: paper, Section IV.A: 6 s at constant velocity.
"""

from __future__ import annotations

from bisect import insort
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from data.pipeline.shared_lanes import overlap_length, pair_gap
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import Track

HORIZON = 6.0  # [s], paper, Section IV.A
AT_START = 1  # ours: steps; a track that begins this early was inside when the recording began


def extrapolate(tracks: Sequence[Track], intersection: Intersection, dropped: Counter[str]) -> list[Track]:
    """The tracks, extended into the past where they enter during the recording, in order of entry.

    Not extended: tracks that were inside at the start, and tracks first seen beyond their stop line. An
    extension ends at the start of the recording and of the route, and where it would overlap another
    vehicle in a shared lane; where two extensions overlap, the vehicle that entered later loses.
    """
    ordered = sorted(tracks, key=lambda track: (track.start, track.id))
    done: list[Track] = []
    for number, track in enumerate(ordered):
        longer = track
        if track.start <= AT_START:
            dropped["inside at the start"] += 1
        elif track.position[0] + 0.5 * track.length >= intersection.routes[track.route].stop_line:
            dropped["first seen beyond the stop line"] += 1
        else:
            longer = _extended(track)
            if _ends_at_route_start(track, longer):
                dropped["reaches the start of the route"] += 1
            others = [other for other in (*done, *ordered[number + 1 :]) if other.start < track.start]
            others = [other for other in others if other.stop > longer.start]
            free = _first_free(longer, track.start, others, intersection)
            if free > longer.start:
                dropped["cut at another vehicle"] += 1
                dropped["steps cut at another vehicle"] += free - longer.start
                longer = _without(longer, free - longer.start)
        insort(done, longer, key=lambda one: one.start)
    return sorted(done, key=lambda track: (track.start, track.id))


def _extended(track: Track) -> Track:
    speed = float(track.speed[0])
    steps = min(round(HORIZON / DT), track.start)
    back = np.arange(steps, 0, -1)
    position = float(track.position[0]) - speed * DT * back
    position = position[position >= 0.0]
    count = len(position)
    return replace(
        track,
        start=track.start - count,
        position=np.concatenate([position.astype(np.float32), track.position]),
        speed=np.concatenate([np.full(count, speed, np.float32), track.speed]),
        acceleration=np.concatenate([np.zeros(count, np.float32), track.acceleration]),
        observed=np.concatenate([np.zeros(count, np.bool_), track.observed]),
    )


def _ends_at_route_start(track: Track, longer: Track) -> bool:
    return track.start - longer.start < min(round(HORIZON / DT), track.start)


def _first_free(longer: Track, entered: int, others: Sequence[Track], intersection: Intersection) -> int:
    """The first step from which the extension, up to step `entered`, overlaps and passes nobody."""
    first = longer.start
    for other in others:
        gap = pair_gap(longer, other, intersection)
        if gap is None:
            continue
        before = gap.steps < entered
        ahead = gap.ahead[before]
        side = np.sign(gap.ahead[~before][0]) if (~before).any() else np.sign(ahead[-1])
        wrong = gap.steps[before][(np.abs(ahead) < overlap_length(longer, other)) | (np.sign(ahead) != side)]
        if len(wrong):
            first = max(first, int(wrong[-1]) + 1)
    return first


def _without(track: Track, count: int) -> Track:
    """The track without its first `count` states."""
    return replace(
        track,
        start=track.start + count,
        position=track.position[count:],
        speed=track.speed[count:],
        acceleration=track.acceleration[count:],
        observed=track.observed[count:],
    )
