"""Simulated motions along routes as the tracks of a recording: field of view, swerves, pedestrians."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from data.sumo.demand import Driver
from data.sumo.network import Path2D
from intersection_env.maps.source import MapSource

FRAME_RATE = 25.0  # [1/s]
SWERVE = 1.9  # [m], ours: how far to the left a car passes a bicycle
SWERVE_GAP = 1.5  # [m], ours: gap to the bicycle at which a swerve is complete, and at which its return begins
SWERVE_TIME = 2.2  # [s], ours: how long a car takes to move to the left, or back
WALKING_SPEED = 1.0, 1.6  # [m/s]
WALK_CLEARANCE = 2.5  # [m], ours: no vehicle comes nearer to a crossing pedestrian
PEDESTRIANS = 3, 6  # in a recording

Floats = NDArray[np.float64]


@dataclass
class Motion:
    """A vehicle's way along its route, frame by frame.

    front: (frame,) arc length of the front bumper [m]; speed, acceleration: (frame,) [m/s], [m/s^2];
    offset: (frame,) how far left of the centreline it drives [m].
    """

    driver: Driver
    first_frame: int
    front: Floats
    speed: Floats
    acceleration: Floats
    offset: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self.offset = np.zeros(len(self.front))


@dataclass(frozen=True)
class Track:
    """A road user as a recording shows it.

    position, velocity, acceleration: (frame, 2) [m], [m/s], [m/s^2]; heading: (frame,) [rad].
    """

    kind: str
    first_frame: int
    length: float
    width: float
    position: Floats
    heading: Floats
    velocity: Floats
    acceleration: Floats


def track(motion: Motion, path: Path2D, view: tuple[float, float], frames: int) -> Track | None:
    """The part of a motion whose centre lies in the field of view, `view` by arc length [m]; None if there is none."""
    centre = motion.front - 0.5 * motion.driver.length
    frame = motion.first_frame + np.arange(len(centre))
    seen = np.flatnonzero((centre >= view[0]) & (centre <= view[1]) & (frame >= 0) & (frame < frames))
    if len(seen) < 2:
        return None
    keep = slice(seen[0], seen[-1] + 1)
    centre, speed, offset = centre[keep], motion.speed[keep], motion.offset[keep]
    along = path.heading(centre)
    aside = np.gradient(offset, 1.0 / FRAME_RATE)
    heading = along + np.arctan2(aside, np.maximum(speed, 1.0))
    tangent = np.stack([np.cos(along), np.sin(along)], axis=1)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    bend = (path.heading(centre + 0.5) - path.heading(centre - 0.5)) * speed**2
    sideways = bend + np.gradient(aside, 1.0 / FRAME_RATE)
    return Track(
        motion.driver.kind,
        int(frame[seen[0]]),
        motion.driver.length,
        motion.driver.width,
        path.at(centre) + offset[:, None] * normal,
        heading,
        speed[:, None] * tangent + aside[:, None] * normal,
        motion.acceleration[keep][:, None] * tangent + sideways[:, None] * normal,
    )


def view_of(source: MapSource, path: Path2D, view: dict[str, float]) -> tuple[float, float]:
    """The arc lengths between which a route lies in the field of view [m]; view: as of `Place`."""
    entry, _, leave = path.id.partition("-")
    before, beyond = (view[source.arms[arm].right_of_way] for arm in (entry, leave))
    return path.stop_line - before, path.junction_end + beyond


def ride_on(motion: Motion, seconds: float) -> None:
    """Let a vehicle that has left the simulation go on at its last speed."""
    count = int(seconds * FRAME_RATE)
    speed = float(motion.speed[-1])
    motion.front = np.r_[motion.front, motion.front[-1] + speed / FRAME_RATE * np.arange(1, count + 1)]
    motion.speed = np.r_[motion.speed, np.full(count, speed)]
    motion.acceleration = np.r_[motion.acceleration, np.zeros(count)]
    motion.offset = np.zeros(len(motion.front))


def swerve(motion: Motion, bicycle: Motion, shift: float, from_frame: int) -> None:
    """Make a vehicle pass a bicycle on its left; position on the bicycle's route = position + `shift` [m]."""
    begin = max(motion.first_frame, from_frame)
    end = min(motion.first_frame + len(motion.front), bicycle.first_frame + len(bicycle.front))
    if begin >= end:
        return
    mine = slice(begin - motion.first_frame, end - motion.first_frame)
    ridden = bicycle.front[begin - bicycle.first_frame : end - bicycle.first_frame]
    front = motion.front[mine] + shift
    beside = np.flatnonzero(front > ridden - bicycle.driver.length - SWERVE_GAP)
    if not len(beside):
        return
    past = np.flatnonzero(front - motion.driver.length > ridden + SWERVE_GAP)
    time = np.arange(end - begin) / FRAME_RATE
    out = min(SWERVE_TIME, float(time[beside[0]])) + 1.0 / FRAME_RATE
    aside = _smooth((time - time[beside[0]]) / out + 1.0)
    back = _smooth((time - time[past[0]]) / SWERVE_TIME) if len(past) else 0.0
    motion.offset[mine] = np.maximum(motion.offset[mine], SWERVE * (aside - back))


def _smooth(value: Floats) -> Floats:
    inside = np.clip(value, 0.0, 1.0)
    return np.asarray(inside**3 * (10.0 - 15.0 * inside + 6.0 * inside**2))


def walks(rng: np.random.Generator, source: MapSource, tracks: list[Track], frames: int) -> Iterator[Track]:
    """Pedestrians who cross an arm, each as soon as no vehicle comes near them on their way."""
    for _ in range(int(rng.integers(PEDESTRIANS[0], PEDESTRIANS[1] + 1))):
        arm = list(source.arms)[int(rng.integers(len(source.arms)))]
        begin, end = _crosswalk(source, arm, float(rng.uniform(8.0, 14.0)))
        if rng.random() < 0.5:
            begin, end = end, begin
        speed = float(rng.uniform(*WALKING_SPEED))
        direction = (end - begin) / np.linalg.norm(end - begin)
        count = int(np.linalg.norm(end - begin) / speed * FRAME_RATE)
        position = begin + np.outer(np.arange(count) * speed / FRAME_RATE, direction)
        first = int(rng.integers(0, frames - count))
        while first + count < frames and not _is_free(position, first, tracks):
            first += int(FRAME_RATE / 5.0)
        if first + count < frames:
            velocity = np.tile(speed * direction, (count, 1))
            heading = np.full(count, np.arctan2(direction[1], direction[0]))
            yield Track("pedestrian", first, 0.0, 0.0, position, heading, velocity, np.zeros((count, 2)))


def _crosswalk(source: MapSource, arm: str, distance: float) -> tuple[Floats, Floats]:
    """Where a pedestrian leaves one kerb and reaches the other, so far [m] outside an arm's lane ends."""
    entering = {route.approach[-1] for route in source.routes if route.entry == arm}
    leaving = {route.leaving[0] for route in source.routes if route.exit == arm}
    ends = [(source.lanes[lane].points[::-1], source.lanes[lane].width[-1]) for lane in sorted(entering)]
    ends += [(source.lanes[lane].points, source.lanes[lane].width[0]) for lane in sorted(leaving)]
    outward = np.mean([(points[1] - points[0]) / np.linalg.norm(points[1] - points[0]) for points, _ in ends], axis=0)
    outward /= np.linalg.norm(outward)
    across = np.array([-outward[1], outward[0]])
    base = np.mean([points[0] for points, _ in ends], axis=0) + distance * outward
    sides = [(float((points[0] - base) @ across), width) for points, width in ends]
    low = min(side - 0.5 * width for side, width in sides) - 1.0
    high = max(side + 0.5 * width for side, width in sides) + 1.0
    return base + low * across, base + high * across


def _is_free(position: Floats, first: int, tracks: list[Track]) -> bool:
    """Whether no vehicle's body comes within the clearance of a walk that begins at a frame."""
    for one in tracks:
        begin = max(first, one.first_frame)
        end = min(first + len(position), one.first_frame + len(one.position))
        if begin >= end:
            continue
        theirs = slice(begin - one.first_frame, end - one.first_frame)
        apart = position[begin - first : end - first] - one.position[theirs]
        cos, sin = np.cos(one.heading[theirs]), np.sin(one.heading[theirs])
        along = np.abs(cos * apart[:, 0] + sin * apart[:, 1]) - 0.5 * one.length
        aside = np.abs(cos * apart[:, 1] - sin * apart[:, 0]) - 0.5 * one.width
        if (np.hypot(np.maximum(along, 0.0), np.maximum(aside, 0.0)) < WALK_CLEARANCE).any():
            return False
    return True


def overlaps(tracks: list[Track], step: int = 5) -> int:
    """In how many pairs of vehicles do the rectangles overlap at some looked-at frame (every `step`-th)?"""
    boxes: dict[int, list[tuple[int, float, float, float]]] = {}
    for number, one in enumerate(tracks):
        for index in range(-one.first_frame % step, len(one.position), step):
            row = number, *one.position[index], one.heading[index]
            boxes.setdefault(one.first_frame + index, []).append(row)
    pairs = [(a, b) for rows in boxes.values() for i, a in enumerate(rows) for b in rows[i + 1 :]]
    if not pairs:
        return 0
    left, right = np.array([a for a, _ in pairs]), np.array([b for _, b in pairs])
    size = np.array([(one.length, one.width) for one in tracks])
    touch = _touch_in_frame(left, right, size) & _touch_in_frame(right, left, size)
    tracks_that_touch = np.stack([left[touch], right[touch]], axis=1)[..., 0]  # (pair, 2)
    return len(np.unique(tracks_that_touch, axis=0))


def _touch_in_frame(one: Floats, other: Floats, size: Floats) -> NDArray[np.bool_]:
    """Whether the boxes (track, x, y, heading) meet in both directions of the first box's frame."""
    (track, x, y, heading), (other_track, other_x, other_y, other_heading) = one.T, other.T
    length, width = size[track.astype(int)].T
    other_length, other_width = size[other_track.astype(int)].T
    turn, apart_x, apart_y = other_heading - heading, other_x - x, other_y - y
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    c, s = np.cos(heading), np.sin(heading)
    along, aside = np.abs(c * apart_x + s * apart_y), np.abs(c * apart_y - s * apart_x)
    reach_along = 0.5 * (length + other_length * cos + other_width * sin)
    reach_aside = 0.5 * (width + other_length * sin + other_width * cos)
    return np.asarray((along < reach_along) & (aside < reach_aside))
