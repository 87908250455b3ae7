"""What CSV files of recordings must agree on: each check raises one ValueError that names file, line and column."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from data.formats.road_users import check_size, class_of
from data.recording import Floats, Ids, Integers
from intersection_env import _core

if TYPE_CHECKING:
    import pandas as pd

SIZE_TOLERANCE = 0.1  # [m], ours: a track's size may differ by this much between its two files


class Files(NamedTuple):
    """The three files of one recording."""

    tracks: Path
    tracks_meta: Path
    recording_meta: Path


def check_recording_id(path: Path, table: pd.DataFrame, recording: str) -> None:
    """Refuses a table that names another recording than its file does."""
    wrong = np.flatnonzero(table["recordingId"].to_numpy() != int(recording))
    if len(wrong):
        found = table["recordingId"].iloc[wrong[0]]
        raise ValueError(f"{path}, line {wrong[0] + 2}: recordingId is {found}, the file's name says {recording}")


def check_meta(path: Path, meta: pd.DataFrame) -> None:
    """Refuses a track that is there twice, of an unknown class, or of a size that the core refuses."""
    seen: dict[int, int] = {}
    columns = (meta[name].to_numpy() for name in ("trackId", "class", "length", "width"))
    for line, (track, road_user, length, width) in enumerate(zip(*columns, strict=True), start=2):
        if track in seen:
            raise ValueError(f"{path}, line {line}: track {track} is there twice, first in line {seen[track]}")
        seen[track] = line
        where = f"{path}, line {line}"
        check_size(f"{where}: track {track}", class_of(f"{where}: class", road_user), length, width)


def check_speed(path: Path, track: Ids, velocity: Floats, columns: str = "xVelocity, yVelocity") -> None:
    """Refuses a row whose speed the core refuses; velocity: (row, 2) [m/s]."""
    speed = np.hypot(*velocity.T)
    wrong = np.flatnonzero(speed > _core.MOST_SPEED)
    if len(wrong):
        row = wrong[0]
        raise ValueError(
            f"{path}, line {row + 2}: the speed of track {track[row]} ({columns}) is {speed[row]:g} m/s;"
            f" wanted at most {_core.MOST_SPEED:g}"
        )


def check_order(path: Path, track: Ids, frame: Integers, offsets: Integers) -> None:
    """Refuses tracks in several blocks, and frames out of order or missing; offsets: first row of each block."""
    heads = track[offsets[:-1]]
    unique, first = np.unique(heads, return_index=True)
    if len(unique) < len(heads):
        again = np.setdiff1d(np.arange(len(heads)), first)[0]
        earlier = offsets[np.flatnonzero(heads == heads[again])[0]]
        raise ValueError(
            f"{path}, line {offsets[again] + 2}: duplicate track {heads[again]}: its rows began in line {earlier + 2}"
            " and were over; wanted each track in one block"
        )
    step = np.diff(frame)
    same = track[1:] == track[:-1]
    wrong = np.flatnonzero(same & (step != 1))
    if len(wrong):
        row = int(wrong[0]) + 1
        comes_later = (frame[row - 1] + 1) in frame[track == track[row]]
        what = "frames out of order" if step[row - 1] < 1 or comes_later else "a gap in the frames"
        raise ValueError(
            f"{path}, line {row + 2}: {what}: frame {frame[row]} of track {track[row]} follows frame {frame[row - 1]}"
        )
    if frame.min() < 0:
        row = int(np.argmax(frame < 0))
        raise ValueError(f"{path}, line {row + 2}: frame is {frame[row]}; wanted 0 or more")


def matched(files: Files, meta: pd.DataFrame, rows: pd.DataFrame, offsets: Integers) -> pd.DataFrame:
    """The tracks' meta data in the order of the tracks file, checked against it."""
    ids = rows["trackId"].to_numpy()[offsets[:-1]]
    _check_same_tracks(files, set(meta["trackId"].tolist()), set(ids.tolist()))
    line = dict(zip(meta["trackId"].tolist(), range(2, len(meta) + 2), strict=True))
    meta = meta.set_index("trackId", drop=False).loc[ids]
    frame = rows["frame"].to_numpy()
    stated = {
        "initialFrame": frame[offsets[:-1]],
        "finalFrame": frame[offsets[1:] - 1],
        "numFrames": np.diff(offsets),
    }
    for name, found in stated.items():
        _refuse_difference(files, ids, line, name, meta[name].to_numpy(), found, 0.0)
    for name in ("width", "length"):
        values = rows[name].to_numpy()
        if (values < 0.0).any():
            row = int(np.argmax(values < 0.0))
            raise ValueError(f"{files.tracks}, line {row + 2}: {name} is {values[row]:g} m; wanted 0 or more")
        for extreme in (np.minimum, np.maximum):
            size = extreme.reduceat(values, offsets[:-1])
            _refuse_difference(files, ids, line, name, meta[name].to_numpy(), size, SIZE_TOLERANCE)
    return meta


def _check_same_tracks(files: Files, meta: set[int], tracks: set[int]) -> None:
    for missing, where, other in (
        (meta - tracks, files.tracks, files.tracks_meta),
        (tracks - meta, files.tracks_meta, files.tracks),
    ):
        if missing:
            raise ValueError(f"{where}: track {min(missing)} of {other.name} is missing ({len(missing)} in all)")


def _refuse_difference(
    files: Files,
    ids: Integers,
    line: dict[int, int],
    name: str,
    meta: Floats | Integers,
    tracks: Floats | Integers,
    tolerance: float,
) -> None:
    wrong = np.flatnonzero(np.abs(meta - tracks) > tolerance)
    if len(wrong):
        k = wrong[0]
        raise ValueError(
            f"{files.tracks_meta}, line {line[int(ids[k])]}: {name} of track {ids[k]} is {meta[k]:g},"
            f" but {files.tracks.name} has {tracks[k]:g}"
        )
