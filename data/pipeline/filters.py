"""Finds the stretches of a recording that scenes may not hold: someone crosses, or someone overtakes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.pipeline.projection import STANDS, Projection
from data.pipeline.route_line import RouteLine
from data.pipeline.shared_lanes import PairGap, overlap_length, pair_gap
from data.recording import PEDESTRIAN, Recording
from intersection_env import _core
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import Track
from intersection_env.traffic import naming

NEAR = 35.0  # [m], paper: the field of view reaches this far along the main road; arc length from the junction
KERB = 0.3  # [m], ours: a pedestrian counts as on the roadway from this far inside the lane's edge
CROSSING_MARGIN = 1.0  # [s], ours: drivers brake before the pedestrian steps on the road, and start after
OVERTAKING_MARGIN = 1.0  # [s], ours: the one who overtakes has left the lane before bodies are side by side
DRIFT = np.float32(0.1)  # [m], ours: a replay adds up accelerations, and may bring a vehicle so far from its place


class Interval(NamedTuple):
    """Steps of the recording from `begin` to before `end`, and why they are cut out."""

    reason: str
    begin: int
    end: int


def crossings(recording: Recording, projection: Projection, intersection: Intersection) -> list[Interval]:
    """When someone without a route is on the roadway near the junction, pedestrians above all.

    recording: resampled to 0.2 s. A bicycle, or a car that fits no route, is seen by the drivers but not
    by who reads the scene, so these stretches go, too.
    """
    reasons = {"bicycle": "bicycle without a route", PEDESTRIAN: "crossing pedestrian"}
    walkers = [index for index, road_user in enumerate(recording.road_user) if road_user == PEDESTRIAN]
    who = [*walkers, *projection.unassigned]
    who = [index for index in who if recording.offsets[index] < recording.offsets[index + 1]]
    if not who:
        return []
    rows = np.concatenate([np.arange(recording.offsets[index], recording.offsets[index + 1]) for index in who])
    owner = np.repeat(who, np.diff(recording.offsets)[who])
    on_road = _on_roadway(np.stack([recording.x[rows], recording.y[rows]], axis=1), intersection)
    margin = round(CROSSING_MARGIN / DT)
    intervals: list[Interval] = []
    for index in who:
        reason = reasons.get(recording.road_user[index], "vehicle without a route")
        if projection.unassigned.get(index) == STANDS:
            reason = "standing vehicle without a route"
        frames = recording.frame[rows[on_road & (owner == index)]]
        intervals += [Interval(reason, b - margin, e + margin) for b, e in _runs(frames)]
    return intervals


def overtakings(tracks: Sequence[Track], intersection: Intersection) -> list[Interval]:
    """When the order of two vehicles inverts along a lane they share, or their bodies overlap there."""
    margin = round(OVERTAKING_MARGIN / DT)
    intervals: list[Interval] = []
    for first, second in together(tracks):
        gap = pair_gap(first, second, intersection)
        if gap is None:
            continue
        overlapping = np.abs(gap.ahead) < overlap_length(first, second)
        change = np.flatnonzero(np.diff(np.sign(gap.ahead)) != 0.0)
        if len(change):
            intervals += _overtaking(gap, overlapping, change, margin)
        else:
            runs = _runs(gap.steps[overlapping])
            intervals += [Interval("overlapping vehicles", b - margin, e + margin) for b, e in runs]
    return intervals


def touchings(tracks: Sequence[Track], intersection: Intersection) -> list[Interval]:
    """When two vehicles collide by the core's own measures.

    They touch, which `Traffic` would refuse, above all where paths cross; or they come so close that the worlds
    call it a collision: bodies half a metre apart, or even full braking would not keep them apart. So drive
    those who are about to overtake; in a replay they would be punished for it.

    Raises:
        ValueError: the core refuses a vehicle or a moment; the message names recording, track and time.
    """
    if not tracks:
        return []
    count = [len(track.position) for track in tracks]
    step = np.concatenate([np.arange(track.start, track.stop) for track in tracks])
    order = np.argsort(step, kind="stable")
    owner = np.repeat(np.arange(len(tracks)), count)[order]
    route = np.array([track.route for track in tracks], np.int32)[owner]
    columns = []
    for name in ("position", "speed"):
        columns.append(np.concatenate([getattr(track, name) for track in tracks])[order])
    for name in ("length", "width"):
        columns.append(np.array([getattr(track, name) for track in tracks], np.float32)[owner])
    columns.append(np.full(len(step), np.inf, np.float32))  # top speeds
    present, begin = np.unique(step[order], return_index=True)
    touching: list[int] = []
    too_close: list[int] = []
    for one, rows in zip(present, map(slice, begin, [*begin[1:], len(step)]), strict=True):
        ids = [tracks[index].id for index in owner[rows]]
        position, speed, length, width, unbounded = (column[rows] for column in columns)
        try:
            with naming(ids):
                traffic = _core.Traffic(intersection.core, route[rows], position, speed, length, width, unbounded)
        except ValueError as error:
            raise ValueError(f"recording {ids[0].partition('/')[0]}, {one * DT:.1f} s: {error}") from None
        found = _core.closest(intersection.core, traffic)
        wider = _core.Traffic(intersection.core, route[rows], position, speed, length, width + DRIFT, unbounded)
        if found is not None and found[0] <= 0.0:
            touching.append(one)
        elif _core.collision(intersection.core, wider) is not None:
            too_close.append(one)
    margin = round(OVERTAKING_MARGIN / DT)
    found_at = {"touching vehicles": touching, "vehicles too close to brake": too_close}
    return [Interval(reason, b - margin, e + margin) for reason, at in found_at.items() for b, e in _runs(np.array(at))]


def together(tracks: Sequence[Track]) -> Iterator[tuple[Track, Track]]:
    """Pairs of tracks that are there at the same time, each once."""
    ordered = sorted(tracks, key=lambda track: track.start)
    for number, first in enumerate(ordered):
        for second in ordered[number + 1 :]:
            if second.start >= first.stop:
                break
            yield first, second


def _overtaking(
    gap: PairGap, overlapping: NDArray[np.bool_], change: NDArray[np.int64], margin: int
) -> Iterator[Interval]:
    """One interval per inversion: from the last step clear of each other before to the first one after."""
    for index in change:
        begin, end = int(index), int(index) + 1
        while begin > 0 and overlapping[begin]:
            begin -= 1
        while end < len(overlapping) - 1 and overlapping[end]:
            end += 1
        yield Interval("overtaking", int(gap.steps[begin]) - margin, int(gap.steps[end]) + 1 + margin)


def _on_roadway(points: NDArray[np.float64], intersection: Intersection) -> NDArray[np.bool_]:
    inside = np.zeros(len(points), dtype=np.bool_)
    for route in intersection.routes:
        line = RouteLine(intersection, route)
        position, distance, _ = line.locate(points)
        begin, end = route.junction
        near = (position > max(begin - NEAR, 0.0)) & (position < min(end + NEAR, route.length))
        inside |= near & (distance < 0.5 * line.width(position) - KERB)
    return inside


def _runs(steps: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Runs of consecutive steps, as (begin, end)."""
    if len(steps) == 0:
        return []
    breaks = np.flatnonzero(np.diff(steps) > 1) + 1
    return [(int(run[0]), int(run[-1]) + 1) for run in np.split(steps, breaks)]
