"""The scenes file: a compressed npz without pickle, written whole or not at all, and checked array by array."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.files import written_whole

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
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except DAMAGED as error:
        raise ValueError(f"{path}: not a scenes file, or a damaged one: {error}") from None
    try:
        header = _header(arrays.pop("header", None))
        _check_arrays(arrays)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return header, arrays


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
