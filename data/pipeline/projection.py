"""Puts each recorded vehicle on the route it drives, and its motion along that route.

A track fits a route if it stays in the route's lane, moves the route's way and not backwards. The
measure is the *excess*: how far the centre lies from the route's centreline, less what a lane wider
than 3.5 m leaves free (right-turners and bicycles keep to the edge of such lanes). A vehicle that stands
all along moves no way; its body's heading says which.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.pipeline.route_line import Floats, RouteLine
from data.pipeline.standing import is_parked, stands_all_along
from data.recording import VEHICLES, Recording
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import Track

RMS_EXCESS = 2.0  # [m], ours: real drivers cut corners all along a turn; neighbouring lanes are 2.8 m apart
MAX_EXCESS = 3.0  # [m], ours: left-turners cut corners by up to 2 m
ALONG = 0.9  # ours: least share of the way driven that leads along the route (a mean angle of 25 degrees)
BACKWARD = 1.0  # [m], ours: a standing vehicle's position jitters by less
LEAST_SAMPLES = 5  # ours: a track shorter than 1 s shows neither lane nor manner of driving
TELLING = 1.25  # [m], ours: routes are told apart by more, so that who drives 1 m aside is on no other's
BICYCLE_SIZE = (1.8, 0.6)  # [m], ours: a city bicycle with its rider; length and width, inD gives 0

CHANGES = "changes lanes on its way, counted on the last"
STANDS = "stands all along, without a route"

Flags = NDArray[np.bool_]


class Fit(NamedTuple):
    """How well the tracks fit one route; arrays over tracks, and over rows where said."""

    fits: Flags
    in_lane: Flags
    """Fits, but for going backwards."""
    rms: Floats
    position: Floats
    """(row,) [m]"""
    distance: Floats
    """(row,) from the centreline [m]."""
    inside: Flags
    """(row,) beside the route, not before its start or beyond its end."""
    excess: Floats
    """(row,) [m]; 0 where not inside."""


@dataclass(frozen=True)
class Projection:
    """The vehicles of one recording on their routes, at 5 Hz.

    tracks: starts count steps of the recording. unassigned: indices of the recording's vehicles that take
    part in traffic but are on no route, with the reason. dropped: tracks by reason; those that stand all
    along are counted also where they are on a route.
    """

    tracks: tuple[Track, ...]
    unassigned: dict[int, str]
    dropped: Counter[str]


def project(
    recording: Recording, intersection: Intersection, rms_excess: float = RMS_EXCESS, max_excess: float = MAX_EXCESS
) -> Projection:
    """Assigns the vehicles of a recording, resampled to 0.2 s, to routes and projects their motion.

    rms_excess, max_excess: how far the tracks may lie from a route that they fit [m].
    """
    dropped: Counter[str] = Counter()
    lines = [RouteLine(intersection, route) for route in intersection.routes]
    candidates = _candidates(recording, lines, dropped)
    unassigned: dict[int, str] = {}
    tracks: list[Track] = []
    if not candidates:
        return Projection((), unassigned, dropped)
    begin, end = recording.offsets[candidates], recording.offsets[np.add(candidates, 1)]
    rows = np.concatenate([np.arange(b, e) for b, e in zip(begin, end, strict=True)])
    offsets = np.concatenate([[0], np.cumsum(end - begin)])
    points = np.stack([recording.x[rows], recording.y[rows]], axis=1)
    stands = [stands_all_along(recording, index) for index in candidates]
    motion = _motion(recording, rows, np.repeat(stands, end - begin))
    fits = [_fit(line, motion, points, offsets, (rms_excess, max_excess)) for line in lines]
    changes = _with_lane_changes(fits, lines, motion, offsets, (rms_excess, max_excess))
    for number, index in enumerate(candidates):
        own = slice(offsets[number], offsets[number + 1])
        chosen = _choose(fits, lines, number, own)
        if isinstance(chosen, str) and not isinstance(changed := _choose(changes, lines, number, own), str):
            dropped[CHANGES] += 1
            chosen = changed
        if stands[number]:
            if isinstance(chosen, str):
                chosen = STANDS
            else:
                dropped["stands all along, on a route"] += 1
        if isinstance(chosen, str):
            unassigned[index] = chosen
            dropped[chosen] += 1
        else:
            inside = offsets[number] + np.flatnonzero(fits[chosen].inside[own])
            tracks.append(_track(recording, index, lines[chosen], rows[inside], fits[chosen].position[inside]))
    return Projection(tuple(tracks), unassigned, dropped)


def _candidates(recording: Recording, lines: list[RouteLine], dropped: Counter[str]) -> list[int]:
    """Indices of the vehicles that take part in traffic and are there long enough."""
    found: list[int] = []
    for index, road_user in enumerate(recording.road_user):
        rows = slice(recording.offsets[index], recording.offsets[index + 1])
        if road_user not in VEHICLES:
            dropped["pedestrian"] += 1
        elif rows.stop - rows.start < LEAST_SAMPLES:
            dropped["shorter than 1 s"] += 1
        elif stands_all_along(recording, index) and is_parked(recording, index, lines):
            dropped["parked"] += 1
        else:
            found.append(index)
    return found


def _motion(recording: Recording, rows: NDArray[np.int64], stands: Flags) -> Floats:
    """(row, 2): the velocity; where the vehicle stands all along, the way that its body points instead."""
    heading = recording.heading[rows]
    pointed = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    sized = np.repeat(recording.length > 0.0, np.diff(recording.offsets))[rows]
    return np.where(stands[:, None], pointed * sized[:, None], recording.velocity[rows])


def _fit(
    line: RouteLine,
    motion: Floats,
    points: Floats,
    offsets: NDArray[np.int64],
    tolerance: tuple[float, float],
) -> Fit:
    position, distance, excess = line.locate(points)
    inside = (position > 0.0) & (position < line.route.length)
    excess = excess * inside
    return _judged(line, (position, distance, inside, excess), motion, offsets, tolerance)


def _judged(
    line: RouteLine,
    place: tuple[Floats, Floats, Flags, Floats],
    motion: Floats,
    offsets: NDArray[np.int64],
    tolerance: tuple[float, float],
) -> Fit:
    """Which tracks fit a route; place: the last four columns of `Fit`."""
    position, distance, inside, excess = place
    count = np.add.reduceat(inside, offsets[:-1], dtype=np.int64)
    rms = np.sqrt(np.add.reduceat(excess**2, offsets[:-1]) / np.maximum(count, 1))
    motion = motion * inside[:, None]
    along = np.add.reduceat((motion * line.direction(position)).sum(axis=1), offsets[:-1])
    way = np.add.reduceat(np.hypot(*motion.T), offsets[:-1])
    track = 1e6 * np.repeat(np.arange(len(count)), np.diff(offsets))  # keeps the tracks' maxima apart
    behind = np.maximum.accumulate(position + track) - track - position
    backward = np.maximum.reduceat(behind, offsets[:-1])
    entered = inside & ~np.concatenate([[False], inside[:-1]])
    entered[offsets[:-1]] = inside[offsets[:-1]]
    once = np.add.reduceat(entered, offsets[:-1], dtype=np.int64) == 1
    near = (rms <= tolerance[0]) & (np.maximum.reduceat(excess, offsets[:-1]) <= tolerance[1])
    in_lane = near & once & (count >= LEAST_SAMPLES)
    fits = in_lane & (along >= ALONG * way) & (backward <= BACKWARD)
    return Fit(fits, in_lane, rms, position, distance, inside, excess)


def _with_lane_changes(
    fits: list[Fit],
    lines: list[RouteLine],
    motion: Floats,
    offsets: NDArray[np.int64],
    tolerance: tuple[float, float],
) -> list[Fit]:
    """The fits where a vehicle may drive in any lane that leads from the same arm to the same other one."""
    found = []
    for line, fit in zip(lines, fits, strict=True):
        lanes = [
            one.excess + ~one.inside * 1e6 for one, beside in zip(fits, lines, strict=True) if _beside(beside, line)
        ]
        excess = np.where(fit.inside, np.min(lanes, axis=0), 0.0)
        found.append(_judged(line, (fit.position, fit.distance, fit.inside, excess), motion, offsets, tolerance))
    return found


def _beside(one: RouteLine, other: RouteLine) -> bool:
    return (one.route.entry, one.route.exit) == (other.route.entry, other.route.exit)


def _choose(fits: list[Fit], lines: list[RouteLine], number: int, rows: slice) -> int | str:
    """The route of one track, or the reason why it has none.

    Routes that fit about equally were seen where they share a lane, or little beyond. Then the last
    position decides, then the first. If all of the track lies in the exit lane that they share, they
    are the same to all that matters from there on, and the first is taken. If they lead side by side from one arm
    to one other, the nearest is.
    """
    rivals = [route for route, fit in enumerate(fits) if fit.fits[number]]
    if not rivals:
        return "drives backwards" if any(fit.in_lane[number] for fit in fits) else "fits no route"
    least = min(fits[route].rms[number] for route in rivals)
    rivals = [route for route in rivals if fits[route].rms[number] <= least + TELLING]
    for end in (-1, 0):
        distance = {route: fits[route].distance[rows][fits[route].inside[rows]][end] for route in rivals}
        rivals = [route for route in rivals if distance[route] < min(distance.values()) + TELLING]
    if len(rivals) == 1:
        return rivals[0]
    begin = {route: fits[route].position[rows][fits[route].inside[rows]][0] for route in rivals}
    if all(begin[route] >= lines[route].route.junction[1] for route in rivals):
        return rivals[0]
    if all(_beside(lines[route], lines[rivals[0]]) for route in rivals):
        return min(rivals, key=lambda route: float(fits[route].distance[rows][fits[route].inside[rows]][-1]))
    return "ambiguous route"


def _track(recording: Recording, index: int, line: RouteLine, rows: NDArray[np.int64], position: Floats) -> Track:
    stretch = line.stretch(position, np.stack([recording.x[rows], recording.y[rows]], axis=1))
    direction = line.direction(position) * stretch[:, None]
    speed = (recording.velocity[rows] * direction).sum(axis=1)
    acceleration = (recording.acceleration[rows] * direction).sum(axis=1)
    length, width = recording.length[index], recording.width[index]
    if recording.road_user[index] == "bicycle":
        length, width = BICYCLE_SIZE
    return Track(
        id=f"{recording.id}/{recording.track_id[index]}",
        road_user=recording.road_user[index],
        route=line.route.index,
        length=float(length),
        width=float(width),
        start=int(recording.frame[rows[0]]),
        # A standing vehicle's measured position and speed jitter around rest; none here drives backwards.
        position=np.maximum.accumulate(position).astype(np.float32),
        speed=np.maximum(speed, 0.0).astype(np.float32),
        acceleration=acceleration.astype(np.float32),
        observed=np.ones(len(rows), dtype=np.bool_),
    )
