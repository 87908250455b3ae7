"""Scenes as the flat arrays of the scenes file, and back; every value is checked on the way in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import ROAD_USERS, SPLITS, Scene, Track


def pack(scenes: tuple[Scene, ...]) -> dict[str, NDArray[Any]]:
    """The arrays of the scenes file, header left out."""
    tracks = [track for scene in scenes for track in scene.tracks]

    def joined(name: str, dtype: type) -> NDArray[Any]:
        return np.concatenate([np.zeros(0, dtype), *(getattr(track, name) for track in tracks)]).astype(dtype)

    return {
        "scene_id": np.array([scene.id for scene in scenes], dtype=np.str_),
        "scene_recording": np.array([scene.recording for scene in scenes], dtype=np.str_),
        "scene_split": np.array([scene.split for scene in scenes], dtype=np.str_),
        "scene_start": np.array([scene.start for scene in scenes], dtype=np.float64),
        "scene_steps": np.array([scene.steps for scene in scenes], dtype=np.int32),
        "scene_tracks": np.cumsum([0, *(len(scene.tracks) for scene in scenes)], dtype=np.int64),
        "track_id": np.array([track.id for track in tracks], dtype=np.str_),
        "track_class": np.array([track.road_user for track in tracks], dtype=np.str_),
        "track_route": np.array([track.route for track in tracks], dtype=np.int16),
        "track_length": np.array([track.length for track in tracks], dtype=np.float32),
        "track_width": np.array([track.width for track in tracks], dtype=np.float32),
        "track_start": np.array([track.start for track in tracks], dtype=np.int32),
        "track_samples": np.cumsum([0, *(len(track.position) for track in tracks)], dtype=np.int64),
        "position": joined("position", np.float32),
        "speed": joined("speed", np.float32),
        "acceleration": joined("acceleration", np.float32),
        "observed": joined("observed", np.bool_),
    }


def unpack(arrays: dict[str, NDArray[Any]], intersection: Intersection) -> tuple[Scene, ...]:
    """The scenes in the arrays; their tracks are views into them.

    arrays: of the right names, types and lengths (`read_scenes_file` sees to that).

    Raises:
        ValueError: a value is out of range; the message names array and entry.
    """
    _check_values(arrays, intersection)
    fields = ("position", "speed", "acceleration", "observed")
    names = ("track_id", "track_class", "track_route", "track_length", "track_width", "track_start")
    columns = zip(*(arrays[name].tolist() for name in names), strict=True)
    offsets = arrays["track_samples"].tolist()
    tracks = [
        Track(*column, *(arrays[name][begin:end] for name in fields))
        for column, begin, end in zip(columns, offsets[:-1], offsets[1:], strict=True)
    ]
    own = ("scene_id", "scene_recording", "scene_split", "scene_start", "scene_steps")
    offsets = arrays["scene_tracks"].tolist()
    rows = zip(*(arrays[name].tolist() for name in own), offsets[:-1], offsets[1:], strict=True)
    return tuple(
        Scene(id, recording, split, start, steps, tuple(tracks[begin:end]))
        for id, recording, split, start, steps, begin, end in rows
    )


def _check_values(arrays: dict[str, NDArray[Any]], intersection: Intersection) -> None:
    samples = np.diff(arrays["track_samples"])
    lengths = np.array([route.length for route in intersection.routes], dtype=np.float32)
    _refuse(arrays, "scene_split", ~np.isin(arrays["scene_split"], SPLITS), f"one of {', '.join(SPLITS)}")
    _refuse(arrays, "track_class", ~np.isin(arrays["track_class"], ROAD_USERS), f"one of {', '.join(ROAD_USERS)}")
    route = arrays["track_route"]
    _refuse(arrays, "track_route", (route < 0) | (route >= len(lengths)), f"0 to {len(lengths) - 1}")
    for name, most in (("track_length", _core.MOST_LENGTH), ("track_width", _core.MOST_WIDTH)):
        is_size = (arrays[name] > 0.0) & (arrays[name] <= most)  # so written, NaN is refused too
        _refuse(arrays, name, ~is_size, f"a positive number, at most {most:g} m")
    _refuse(arrays, "scene_steps", arrays["scene_steps"] < 1, "1 or more")
    for name in ("scene_start", "position", "speed"):
        _refuse(arrays, name, ~((arrays[name] >= 0.0) & np.isfinite(arrays[name])), "a finite number, not negative")
    _refuse(arrays, "acceleration", ~np.isfinite(arrays["acceleration"]), "a finite number")
    limit = np.repeat(lengths[route], samples)
    _refuse(arrays, "position", arrays["position"] > limit, "at most the length of the route")
    steps = np.repeat(arrays["scene_steps"], np.diff(arrays["scene_tracks"]))
    start = arrays["track_start"]
    _refuse(arrays, "track_start", (start < 0) | (start + samples > steps), "a track within its scene")
    _refuse_twice("scene_id", arrays["scene_id"])
    scene = np.repeat(np.arange(len(arrays["scene_id"])), np.diff(arrays["scene_tracks"]))
    _refuse_twice("track_id", np.array([f"{one}: {id}" for one, id in zip(scene, arrays["track_id"], strict=True)]))


def _refuse(arrays: dict[str, NDArray[Any]], name: str, wrong: NDArray[np.bool_], wanted: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong))
        raise ValueError(f'array "{name}", entry {index}: {arrays[name][index]!s}; wanted {wanted}')


def _refuse_twice(name: str, values: NDArray[Any]) -> None:
    unique, first = np.unique(values, return_index=True)
    if len(unique) < len(values):
        index = int(np.setdiff1d(np.arange(len(values)), first)[0])
        raise ValueError(f'array "{name}", entry {index}: {values[index]} is there twice')
