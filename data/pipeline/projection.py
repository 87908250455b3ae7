"""Puts each recorded vehicle on the route it drives, and its motion along that route.

A track fits a route if it stays in the route's lane, moves the route's way and not backwards. The
measure is the *excess*: how far the centre lies from the route's centreline, less what a lane wider
than 3.5 m leaves free (right-turners and bicycles keep to the edge of such lanes).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from data.recording import VEHICLES, Recording
from intersection_env.maps.intersection import Intersection, Route, Sample
from intersection_env.scenes.scene import Track

RMS_EXCESS = 1.5  # [m], ours: half a lane; neighbouring lanes are 2.8 m apart
MAX_EXCESS = 3.0  # [m], ours: left-turners cut corners by up to 2 m
PLAIN_LANE = 3.5  # [m], ours: in a lane of this width or less all of the distance counts
ALONG = 0.9  # ours: least share of the way driven that leads along the route (a mean angle of 25 degrees)
BACKWARD = 1.0  # [m], ours: a standing vehicle's position jitters by less
PARKED_WAY = 2.0  # [m], ours: a vehicle that never gets further than this from where it was first seen
LEAST_SAMPLES = 5  # ours: a track shorter than 1 s shows neither lane nor manner of driving
TELLING = 0.5  # [m], ours: two routes that fit are told apart where their distances differ by this much
STRAIGHT = 1e-3  # [m], ours: points of a centreline that deviate less are left out
BICYCLE_SIZE = (1.8, 0.6)  # [m], ours: a city bicycle with its rider; length and width, inD gives 0

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class RouteLine:
    """A route's centreline, ready for projecting many points onto it."""

    intersection: Intersection
    route: Route
    line: shapely.LineString
    """The centreline without the points that lie straight between others: the straights are most of it."""
    along_line: Floats
    """(sample,) where the route's samples lie on the line [m]; chords are a little shorter than arcs."""

    @classmethod
    def of(cls, intersection: Intersection, route: Route) -> RouteLine:
        points = route.samples[:, :2].astype(np.float64)
        line = shapely.simplify(shapely.LineString(points), STRAIGHT)
        along_line = np.asarray(shapely.line_locate_point(line, shapely.points(points)))
        return cls(intersection, route, line, along_line)

    def locate(self, points: NDArray[np.object_]) -> tuple[Floats, Floats]:
        """Arc length and distance of the nearest place on the route, per point [m]."""
        along = shapely.line_locate_point(self.line, points)
        arc_length = self.intersection.spacing * np.arange(len(self.along_line))
        position = np.minimum(np.interp(along, self.along_line, arc_length), self.route.length)
        return position, shapely.distance(self.line, points)

    def width(self, position: Floats) -> Floats:
        """The lane's width at the given arc lengths [m]."""
        return self._samples(position)[:, Sample.WIDTH].astype(np.float64)

    def direction(self, position: Floats) -> Floats:
        """(position, 2): the unit vector along the route."""
        heading = self._samples(position)[:, Sample.HEADING].astype(np.float64)
        return np.stack([np.cos(heading), np.sin(heading)], axis=1)

    def _samples(self, position: Floats) -> NDArray[np.float32]:
        return self.intersection.sample(self.route.index, position.astype(np.float32))


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


@dataclass(frozen=True)
class Projection:
    """The vehicles of one recording on their routes, at 5 Hz.

    tracks: starts count steps of the recording. unassigned: indices of the recording's moving vehicles
    that are on no route, with the reason. dropped: tracks by reason.
    """

    tracks: tuple[Track, ...]
    unassigned: dict[int, str]
    dropped: Counter[str]


def project(recording: Recording, intersection: Intersection) -> Projection:
    """Assigns the vehicles of a recording, resampled to 0.2 s, to routes and projects their motion."""
    dropped: Counter[str] = Counter()
    candidates = _candidates(recording, dropped)
    unassigned: dict[int, str] = {}
    tracks: list[Track] = []
    if not candidates:
        return Projection((), unassigned, dropped)
    begin, end = recording.offsets[candidates], recording.offsets[np.add(candidates, 1)]
    rows = np.concatenate([np.arange(b, e) for b, e in zip(begin, end, strict=True)])
    offsets = np.concatenate([[0], np.cumsum(end - begin)])
    points = shapely.points(recording.x[rows], recording.y[rows])
    lines = [RouteLine.of(intersection, route) for route in intersection.routes]
    fits = [_fit(line, recording, rows, points, offsets) for line in lines]
    for number, index in enumerate(candidates):
        chosen = _choose(fits, lines, number, slice(offsets[number], offsets[number + 1]))
        if isinstance(chosen, str):
            unassigned[index] = chosen
            dropped[chosen] += 1
        else:
            own = offsets[number] + np.flatnonzero(fits[chosen].inside[offsets[number] : offsets[number + 1]])
            tracks.append(_track(recording, index, lines[chosen], rows[own], fits[chosen].position[own]))
    return Projection(tuple(tracks), unassigned, dropped)


def _candidates(recording: Recording, dropped: Counter[str]) -> list[int]:
    """Indices of the vehicles that move and are there long enough."""
    found: list[int] = []
    for index, road_user in enumerate(recording.road_user):
        rows = slice(recording.offsets[index], recording.offsets[index + 1])
        x, y = recording.x[rows], recording.y[rows]
        if road_user not in VEHICLES:
            dropped["pedestrian"] += 1
        elif len(x) < LEAST_SAMPLES:
            dropped["shorter than 1 s"] += 1
        elif np.hypot(x - x[0], y - y[0]).max() < PARKED_WAY:
            dropped["parked"] += 1
        else:
            found.append(index)
    return found


def _fit(
    line: RouteLine,
    recording: Recording,
    rows: NDArray[np.int64],
    points: NDArray[np.object_],
    offsets: NDArray[np.int64],
) -> Fit:
    position, distance = line.locate(points)
    inside = (position > 0.0) & (position < line.route.length)
    excess = inside * np.maximum(0.0, distance - np.maximum(0.0, 0.5 * (line.width(position) - PLAIN_LANE)))
    count = np.add.reduceat(inside, offsets[:-1], dtype=np.int64)
    rms = np.sqrt(np.add.reduceat(excess**2, offsets[:-1]) / np.maximum(count, 1))
    velocity = recording.velocity[rows] * inside[:, None]
    along = np.add.reduceat((velocity * line.direction(position)).sum(axis=1), offsets[:-1])
    way = np.add.reduceat(np.hypot(*velocity.T), offsets[:-1])
    track = 1e6 * np.repeat(np.arange(len(count)), np.diff(offsets))  # keeps the tracks' maxima apart
    behind = np.maximum.accumulate(position + track) - track - position
    backward = np.maximum.reduceat(behind, offsets[:-1])
    entered = inside & ~np.concatenate([[False], inside[:-1]])
    entered[offsets[:-1]] = inside[offsets[:-1]]
    once = np.add.reduceat(entered, offsets[:-1], dtype=np.int64) == 1
    near = (rms <= RMS_EXCESS) & (np.maximum.reduceat(excess, offsets[:-1]) <= MAX_EXCESS)
    in_lane = near & once & (count >= LEAST_SAMPLES)
    return Fit(in_lane & (along >= ALONG * way) & (backward <= BACKWARD), in_lane, rms, position, distance, inside)


def _choose(fits: list[Fit], lines: list[RouteLine], number: int, rows: slice) -> int | str:
    """The route of one track, or the reason why it has none.

    Routes that fit about equally were seen where they share a lane, or little beyond. Then the last
    position decides, then the first. If all of the track lies in the exit lane that they share, they
    are the same to all that matters from there on, and the first is taken.
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
    return "ambiguous route"


def _track(recording: Recording, index: int, line: RouteLine, rows: NDArray[np.int64], position: Floats) -> Track:
    direction = line.direction(position)
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
