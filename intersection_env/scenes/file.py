"""The scenes file: a compressed npz without pickle, written whole or not at all, and checked array by array."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.files import written_whole
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import ROAD_USERS, SPLITS, Scene, Track

FORMAT = "intersection_env scenes"
VERSION = 1

# name: (type, offsets that say how long it is; an offset array is one longer than what it divides)
ARRAYS: dict[str, tuple[str, str]] = {
    "scene_id": ("str", "scene"),
    "scene_recording": ("str", "scene"),
    "scene_split": ("str", "scene"),
    "scene_start": ("float64", "scene"),
    "scene_steps": ("int32", "scene"),
    "scene_tracks": ("int64", "offsets"),
    "track_id": ("str", "track"),
    "track_class": ("str", "track"),
    "track_route": ("int16", "track"),
    "track_length": ("float32", "track"),
    "track_width": ("float32", "track"),
    "track_start": ("int32", "track"),
    "track_samples": ("int64", "offsets"),
    "position": ("float32", "sample"),
    "speed": ("float32", "sample"),
    "acceleration": ("float32", "sample"),
    "observed": ("bool", "sample"),
}
HEADER: dict[str, type | tuple[type, ...]] = {"map": dict, "dt": (int, float), "provenance": dict, "dropped": dict}
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, OSError, KeyError, ValueError, TypeError, NotImplementedError)


def write_scenes_file(path: Path, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
    """Writes to a temporary file beside `path`, then renames it; the same content gives the same bytes.

    Raises:
        OSError: the file cannot be written; what was there before is then untouched.
    """
    text = json.dumps({"format": FORMAT, "version": VERSION, **header}, sort_keys=True)
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, header=np.array(text), **arrays)


def read_scenes_file(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Header and arrays of a scenes file; types, lengths and offsets are checked, values are not.

    Raises:
        ValueError: the file is damaged or of another version; the message names file and array.
    """
    arrays = _arrays(path)
    try:
        header = _header(arrays.pop("header", None))
        _check_arrays(arrays)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return header, arrays


def map_of_scenes_file(path: Path) -> tuple[str, str]:
    """Name and checksum of the map that a scenes file lies on; nothing else of it is read.

    Raises:
        ValueError: as of `read_scenes_file`.
    """
    arrays = _arrays(path, only=("header",))
    try:
        header = _header(arrays.get("header"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return header["map"]["name"], header["map"]["checksum"]


def _arrays(path: Path, only: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """The arrays in a file, or those of some names that are there."""
    try:
        with path.open("rb") as raw:
            if not zipfile.is_zipfile(raw):  # NumPy would take it for a pickle, and advise how to load that
                raise ValueError('wanted an .npz made by "python -m data.build"')
            raw.seek(0)
            with np.load(raw, allow_pickle=False) as file:
                return {name: _numbers_of(file, name) for name in file.files if only is None or name in only}
    except DAMAGED as error:
        raise ValueError(f"{path}: not a scenes file, or a damaged one: {error}") from None


def _numbers_of(file: Mapping[str, NDArray[Any]], name: str) -> NDArray[Any]:
    try:
        return file[name]
    except ValueError as error:
        if "allow_pickle" in str(error):
            raise ValueError(f'array "{name}" holds Python objects') from None
        raise


def _header(text: NDArray[Any] | None) -> dict[str, Any]:
    if text is None or text.shape != () or text.dtype.kind != "U":
        raise ValueError('no header text; wanted a scenes file made by "python -m data.build"')
    try:
        header = json.loads(str(text))
    except json.JSONDecodeError as error:
        raise ValueError(f"header is not JSON: {error}") from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ValueError(f'header: "format" must be "{FORMAT}"')
    if header.get("version") != VERSION:
        raise ValueError(f'header: "version" is {header.get("version")!r}, this package reads {VERSION}')
    for name, kind in HEADER.items():
        if not isinstance(header.get(name), kind):
            raise ValueError(f'header: "{name}" is missing or of a wrong type: {header.get(name)!r}')
    for name in ("name", "checksum"):
        if not isinstance(header["map"].get(name), str):
            raise ValueError(f'header: "map" has no "{name}"')
    return header


def _check_arrays(arrays: dict[str, NDArray[Any]]) -> None:
    missing, unknown = ARRAYS.keys() - arrays.keys(), arrays.keys() - ARRAYS.keys()
    if missing or unknown:
        which = f'"{min(missing)}" is missing' if missing else f'"{min(unknown)}" does not belong here'
        raise ValueError(f"array {which}")
    for name, (dtype, _) in ARRAYS.items():
        found = arrays[name]
        kind = "str" if found.dtype.kind == "U" else str(found.dtype)
        if kind != dtype or found.ndim != 1:
            raise ValueError(f'array "{name}" is {kind} of shape {found.shape}; wanted {dtype} of one axis')
    length = {"scene": len(arrays["scene_id"])}
    for name, upper, lower in (("scene_tracks", "scene", "track"), ("track_samples", "track", "sample")):
        offsets = arrays[name]
        least = 0 if lower == "track" else 1
        if len(offsets) != length[upper] + 1 or offsets[0] != 0 or (np.diff(offsets) < least).any():
            raise ValueError(
                f'array "{name}" must hold {length[upper] + 1} offsets that begin at 0 and rise by {least} or more'
            )
        length[lower] = int(offsets[-1])
    for name, (_, axis) in ARRAYS.items():
        if axis != "offsets" and len(arrays[name]) != length[axis]:
            raise ValueError(f'array "{name}" has {len(arrays[name])} entries; wanted one per {axis}, {length[axis]}')


def pack(scenes: tuple[Scene, ...]) -> dict[str, NDArray[Any]]:
    """The arrays of the scenes file, header left out."""
    tracks = [track for scene in scenes for track in scene.tracks]
    return pack_tracks(scenes) | {name: joined(tracks, name) for name, (_, axis) in ARRAYS.items() if axis == "sample"}


def pack_tracks(scenes: tuple[Scene, ...]) -> dict[str, NDArray[Any]]:
    """Those of `pack` that have one entry a scene or a track, and the offsets."""
    tracks = [track for scene in scenes for track in scene.tracks]
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
    }


def joined(tracks: Sequence[Track], name: str) -> NDArray[Any]:
    """One array of `pack` that has an entry a sample, to be read only.

    Tracks that `unpack` made, and lie one after the other, as those of a split do, need no copy.
    """
    parts: list[NDArray[Any]] = [getattr(track, name) for track in tracks]
    dtype = np.dtype(ARRAYS[name][0])
    whole = _view_of_all(parts)
    if whole is None or whole.dtype != dtype:
        return np.concatenate([np.zeros(0, dtype), *parts]).astype(dtype, copy=False)
    return whole


def _view_of_all(parts: Sequence[NDArray[Any]]) -> NDArray[Any] | None:
    """What these make up as views of one array, one after the other; None where they are none."""
    base = parts[0].base if parts else None
    if not isinstance(base, np.ndarray) or base.ndim != 1 or not all(part.base is base for part in parts):
        return None
    places = [_address(part) for part in parts]
    end = np.cumsum([places[0], *(part.nbytes for part in parts)])
    if base.strides != (base.itemsize,) or not np.array_equal(end[:-1], places):
        return None
    first = (places[0] - _address(base)) // base.itemsize
    return base[first : first + sum(len(part) for part in parts)]


def _address(array: NDArray[Any]) -> int:
    place: int = array.__array_interface__["data"][0]
    return place


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
