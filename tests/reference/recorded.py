"""Replay, what was recorded: who was where, in which order, and who waited for whom."""

import math
from dataclasses import dataclass

import numpy as np

from tests.reference.decide import Rules
from tests.reference.intersection import Booleans, Floats, Integers, Map
from tests.reference.pairs import all_pairs, conflict_of, is_active
from tests.reference.stops import AT_LINE, STOPPED
from tests.reference.traffic import TIME_STEP, Traffic


@dataclass(frozen=True)
class Track:
    """One recorded vehicle, from step `start` of its scene; position, speed, observed: (time,).

    Not observed: extrapolated into the past.
    """

    route: int
    length: float
    width: float
    max_speed: float
    start: int
    position: Floats
    speed: Floats
    observed: Booleans

    @property
    def stop(self) -> int:
        """The first step at which it is no longer there."""
        return self.start + len(self.position)

    def acceleration(self, time: int) -> float:
        """What takes it on from that step of its scene to the next; at the last one, what brought it there."""
        k = min(time - self.start, len(self.speed) - 2)
        return float(self.speed[k + 1] - self.speed[k]) / TIME_STEP

    @property
    def first_recorded(self) -> int:
        """The step at which it may begin to act."""
        return self.start + int(np.flatnonzero(self.observed)[0])


@dataclass(frozen=True)
class Scene:
    """Recorded tracks, and for how many steps."""

    steps: int
    tracks: tuple[Track, ...]


@dataclass(frozen=True)
class Recording:
    """A scene on its map, and whose gap decisions count: the recorded ones where `rules` is None."""

    intersection: Map
    scene: Scene
    rules: Rules | None


def tracks_at(scene: Scene, time: int) -> list[int]:
    """Who is there at a step."""
    return [k for k, track in enumerate(scene.tracks) if track.start <= time < track.stop]


def recorded_traffic(scene: Scene, time: int, here: list[int]) -> Traffic:
    """Some tracks as they were recorded at a step."""
    tracks = [scene.tracks[k] for k in here]
    return Traffic(
        np.array([track.route for track in tracks], dtype=np.int64),
        *(np.array([getattr(track, name)[time - track.start] for track in tracks]) for name in ("position", "speed")),
        *(np.array([getattr(track, name) for track in tracks]) for name in ("length", "width", "max_speed")),
    )


def reaches(track: Track, line: float) -> float:
    """When the front reaches an arc length, in steps of the scene, linearly between them; infinite if it never does."""
    fronts = track.position + track.length / 2
    reached = np.flatnonzero(fronts >= line)
    if not len(reached):
        return math.inf
    k = int(reached[0])
    return track.start + k - (float((fronts[k] - line) / (fronts[k] - fronts[k - 1])) if k else 0.0)


def yielder_was_first(recording: Recording, i: int, j: int) -> bool:
    """Whether track i, which yields to j, reached their conflict before j did."""
    mine, other = recording.scene.tracks[i], recording.scene.tracks[j]
    for conflict in recording.intersection.conflicts:
        if (conflict.yielder, conflict.prioritized) == (mine.route, other.route):
            return reaches(mine, conflict.begin_yielder) < reaches(other, conflict.begin_prioritized)
    raise ValueError(f"track {i} does not yield to {j}")


def went_second(recording: Recording, pair: tuple[int, int]) -> int:
    """Which of two tracks (yielder, prioritized) went second through their conflict."""
    return pair[1] if yielder_was_first(recording, *pair) else pair[0]


def has_waited(recording: Recording, k: int, time: int) -> int:
    """For how many steps track k has stopped at its line or gone on from there, this one included."""
    track = recording.scene.tracks[k]
    road = recording.intersection.routes[track.route]
    steps = time - track.start + 1
    to_line = road.stop_line - (track.position[:steps] + track.length / 2)
    stops = np.flatnonzero(road.must_stop & (track.speed[:steps] < STOPPED) & (to_line < AT_LINE))
    return steps - int(stops[0]) if len(stops) else 0


def stop_is_asked(recording: Recording, k: int) -> bool:
    """Whether track k has to make a stop: by the recording nobody who passed its line without."""
    track = recording.scene.tracks[k]
    road = recording.intersection.routes[track.route]
    if recording.rules is not None or not road.must_stop:
        return road.must_stop
    past = np.flatnonzero(road.stop_line - (track.position + track.length / 2) < 0)
    if not len(past):
        return True
    return bool(past[0] > 0 and has_waited(recording, k, track.start + int(past[0]) - 1) > 0)


def was_behind(recording: Recording, j: int, i: int) -> bool:
    """Whether track j was recorded behind i where they share a lane."""
    mine, other = recording.scene.tracks[i], recording.scene.tracks[j]
    shares_entry = mine.route == other.route
    for lane in recording.intersection.shared_lanes:
        if (mine.route, other.route) == (lane.a, lane.b):
            merge, merge_other = lane.begin_a, lane.begin_b
        elif (mine.route, other.route) == (lane.b, lane.a):
            merge, merge_other = lane.begin_b, lane.begin_a
        else:
            continue
        shares_entry = shares_entry or max(merge, merge_other) <= -1e6
        if reaches(other, merge_other) > reaches(mine, merge):
            return True
    both = max(mine.start, other.start)
    if not shares_entry or both >= min(mine.stop, other.stop):
        return False
    return bool(other.position[both - other.start] < mine.position[both - mine.start])


def recorded_holds(recording: Recording, time: int, here: list[int]) -> Integers:
    """hold of some tracks: a vehicle is held as long as it waits, by the recorded order, for another that is there."""
    traffic = recorded_traffic(recording.scene, time, here)
    result = np.full(len(here), -1, np.int64)
    for i, j in all_pairs(recording.intersection, traffic):
        conflict = conflict_of(recording.intersection, traffic, i, j)
        assert conflict is not None
        second = i if went_second(recording, (here[i], here[j])) == here[i] else j
        is_open = is_active(
            recording.intersection, traffic, np.ones(len(here), np.bool_), np.array([i, j]), 1 if second == j else 0
        )
        if is_open and (second == i or conflict.by_arrival):
            result[second] = recording.intersection.ranks[traffic.route[second]]
    return result
