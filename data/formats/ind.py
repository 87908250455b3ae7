"""Reads recordings in inD's format, and refuses what is not one.

A recording NN is three files, `NN_tracks.csv`, `NN_tracksMeta.csv` and `NN_recordingMeta.csv`, each
plain or compressed as `.csv.xz`. Source: inD, as described in its own format page.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from data.formats.csv_table import one_of, read_table
from data.formats.ind_checks import Files, check_meta, check_order, check_recording_id, check_speed, matched
from data.formats.road_users import CLASSES
from data.formats.time_step import check_time_step
from data.recording import Recording

TRACKS = {
    **dict.fromkeys(("recordingId", "trackId", "frame"), np.int64),
    **dict.fromkeys(("xCenter", "yCenter", "heading", "width", "length"), np.float64),
    **dict.fromkeys(("xVelocity", "yVelocity", "xAcceleration", "yAcceleration"), np.float64),
}
TRACKS_META = {
    **dict.fromkeys(("recordingId", "trackId", "initialFrame", "finalFrame", "numFrames"), np.int64),
    **dict.fromkeys(("width", "length"), np.float64),
    "class": str,
}
RECORDING_META = {
    **dict.fromkeys(("recordingId", "locationId"), np.int64),
    **dict.fromkeys(("frameRate", "duration"), np.float64),
}


def recording_ids(folder: Path) -> list[str]:
    """The ids of the recordings in a folder, in order: ["00", "01", ...].

    Raises:
        FileNotFoundError: there is no such folder, or no recording in it.
        ValueError: two recordings have equal numbers, as 7 and 07.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; wanted a folder with inD recordings (NN_tracks.csv)")
    found = (re.fullmatch(r"(\d+)_tracks\.csv(\.xz)?", path.name) for path in folder.iterdir())
    ids = sorted({match[1] for match in found if match}, key=lambda number: (int(number), number))
    if not ids:
        raise FileNotFoundError(f"{folder}: no recording here; wanted files named NN_tracks.csv or NN_tracks.csv.xz")
    for one, other in pairwise(ids):
        if int(one) == int(other):
            raise ValueError(
                f"{folder}: {one}_tracks.csv and {other}_tracks.csv have equal numbers; keep one of the two"
            )
    return ids


def recording_files(folder: Path, recording: str) -> Files:
    """The three files of a recording.

    Raises:
        FileNotFoundError: one of them is missing.
        ValueError: one is there twice, plain and compressed.
    """
    return Files(*(one_of(folder, f"{recording}_{kind}.csv") for kind in ("tracks", "tracksMeta", "recordingMeta")))


def read_location(folder: Path, recording: str) -> int:
    """The inD location id of a recording; reads its smallest file only.

    Raises:
        FileNotFoundError, ValueError: as `read_recording`.
    """
    return _recording_meta(recording_files(folder, recording).recording_meta, recording)[0]


def read_recording(folder: Path, recording: str) -> Recording:
    """The recording of that id ("07") in a folder, checked.

    Raises:
        FileNotFoundError: one of its files is missing.
        ValueError: a file is malformed or contradicts another; the message names file, row and column.
    """
    files = recording_files(folder, recording)
    location, frame_rate, duration = _recording_meta(files.recording_meta, recording)
    meta = read_table(files.tracks_meta, TRACKS_META)
    rows = read_table(files.tracks, TRACKS)
    for path, table in ((files.tracks_meta, meta), (files.tracks, rows)):
        check_recording_id(path, table, recording)
    check_meta(files.tracks_meta, meta)
    track = rows["trackId"].to_numpy()
    offsets = np.flatnonzero(np.concatenate([[True], track[1:] != track[:-1], [True]]))
    check_order(files.tracks, track, rows["frame"].to_numpy(), offsets)
    velocity = rows[["xVelocity", "yVelocity"]].to_numpy()
    check_speed(files.tracks, track, velocity)
    meta = matched(files, meta, rows, offsets)
    _check_duration(files, duration, frame_rate, int(rows["frame"].max()))
    result = Recording(
        id=recording,
        location=location,
        frame_rate=frame_rate,
        track_id=meta["trackId"].to_numpy(),
        road_user=tuple(CLASSES[word] for word in meta["class"]),
        length=meta["length"].to_numpy(),
        width=meta["width"].to_numpy(),
        offsets=offsets,
        frame=rows["frame"].to_numpy(),
        x=rows["xCenter"].to_numpy(),
        y=rows["yCenter"].to_numpy(),
        velocity=velocity,
        acceleration=rows[["xAcceleration", "yAcceleration"]].to_numpy(),
        heading=np.radians((rows["heading"].to_numpy() + 180.0) % 360.0 - 180.0),
    )
    check_time_step(files.recording_meta, f"frameRate {frame_rate:g}", result)
    return result


def _recording_meta(path: Path, recording: str) -> tuple[int, float, float]:
    table = read_table(path, RECORDING_META)
    if len(table) != 1:
        raise ValueError(f"{path}: {len(table)} rows of data, one wanted")
    check_recording_id(path, table, recording)
    location, rate, duration = (table[name].iloc[0] for name in ("locationId", "frameRate", "duration"))
    if not 1.0 <= rate <= 1000.0 or abs(rate * 0.2 - round(rate * 0.2)) > 1e-6:
        raise ValueError(f"{path}: frameRate is {rate:g}; wanted a multiple of 5 frames a second (inD: 25)")
    if not duration > 0.0:
        raise ValueError(f"{path}: duration is {duration:g} s; wanted a positive number")
    return int(location), float(rate), float(duration)


def _check_duration(files: Files, duration: float, frame_rate: float, last: int) -> None:
    if last > (duration + 1.0) * frame_rate:
        raise ValueError(
            f"{files.recording_meta}: duration {duration:g} s at frameRate {frame_rate:g} ends before frame {last},"
            f" which {files.tracks.name} holds"
        )
