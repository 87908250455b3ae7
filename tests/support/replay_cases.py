"""Recorded scenes for the core's replay and for its twin: of recordings, or a vehicle at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import Intersection, _core
from intersection_env.constants import BICYCLE_MAX_SPEED
from intersection_env.scenes.scene import Scene
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.support.worlds_cases import Arrays, rules_and_policy


def window(scene: Scene, begin: int, steps: int) -> reference_worlds.Scene:
    """Some steps of a recorded scene, as the twin has it; tracks that are not recorded there are left out."""
    tracks = []
    for track in scene.tracks:
        first, stop = max(track.start, begin), min(track.stop, begin + steps)
        part = slice(first - track.start, stop - track.start)
        if first >= stop or not track.observed[part].any():
            continue
        one = reference_worlds.Track(
            route=track.route,
            length=float(np.float32(track.length)),
            width=float(np.float32(track.width)),
            max_speed=BICYCLE_MAX_SPEED if track.road_user == "bicycle" else np.inf,
            start=first - begin,
            position=track.position[part].astype(np.float64),
            speed=track.speed[part].astype(np.float64),
            observed=track.observed[part].astype(np.bool_),
        )
        tracks.append(one)
    return reference_worlds.Scene(min(steps, scene.steps - begin), tuple(tracks))


def driven(
    name: str,
    route: str,
    position: float,
    speed: float | Sequence[float],
    steps: int = 60,
    start: int = 0,
    length: float = 4.0,
    max_speed: float = np.inf,
) -> reference_worlds.Track:
    """A vehicle recorded at a constant speed, or at these speeds; 4 m by 2 m."""
    fast = np.broadcast_to(np.asarray(speed, np.float32).astype(np.float64), steps).copy()
    travelled = np.concatenate([[0.0], np.cumsum(reference.TIME_STEP * (fast[:-1] + fast[1:]) / 2)])
    where = (position + travelled).astype(np.float32).astype(np.float64)
    index = Intersection.load(name).route_index(route)
    return reference_worlds.Track(index, length, 2.0, max_speed, start, where, fast, np.ones(steps, np.bool_))


def scene_of(*tracks: reference_worlds.Track) -> reference_worlds.Scene:
    return reference_worlds.Scene(max(track.stop for track in tracks), tracks)


def can_act(track: reference_worlds.Track) -> bool:
    """Whether there is a step to drive."""
    return track.first_recorded < track.stop - 1


def core_of_scenes(scenes: Sequence[reference_worlds.Scene]) -> Arrays:
    """The scenes as the core's replay takes them."""
    tracks = [track for scene in scenes for track in scene.tracks]

    def joined(name: str, dtype: type) -> NDArray[Any]:
        return np.concatenate([getattr(track, name) for track in tracks]).astype(dtype)

    return {
        "scene_steps": np.array([scene.steps for scene in scenes], np.int32),
        "scene_tracks": np.cumsum([0, *(len(scene.tracks) for scene in scenes)], dtype=np.int64),
        "track_route": np.array([track.route for track in tracks], np.int32),
        "track_length": np.array([track.length for track in tracks], np.float32),
        "track_width": np.array([track.width for track in tracks], np.float32),
        "track_max_speed": np.array([track.max_speed for track in tracks], np.float32),
        "track_start": np.array([track.start for track in tracks], np.int32),
        "track_samples": np.cumsum([0, *(len(track.position) for track in tracks)], dtype=np.int64),
        "position": joined("position", np.float32),
        "speed": joined("speed", np.float32),
        "observed": joined("observed", np.bool_),
    }


def replay(
    name: str,
    scenes: Sequence[reference_worlds.Scene],
    worlds: int = 1,
    *,
    decisions: str = "recording",
    actors: Sequence[int] | None = None,
    autoreset: str = "off",
    threads: int = 1,
    isa: str | None = None,
    bodies: str = "circles",
) -> _core.Replay:
    """Replayed scenes on a shipped map; decisions: "recording", or a gap rule or "network"."""
    _, policy = rules_and_policy("critical_gap" if decisions == "recording" else decisions)
    arrays = core_of_scenes(scenes)
    tracks = [track for scene in scenes for track in scene.tracks]
    able = [number for number, track in enumerate(tracks) if can_act(track)]
    chosen = np.array(able if actors is None else actors)
    return _core.Replay(
        Intersection.load(name).core,
        policy,
        decisions == "recording",
        arrays,
        chosen.astype(np.int32),
        worlds,
        autoreset,
        threads,
        isa,
        bodies,
    )
