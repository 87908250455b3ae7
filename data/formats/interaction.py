"""Reads recordings in INTERACTION's format, and refuses what is not one.

A recording NNN is `vehicle_tracks_NNN.csv` and, where people walk or cycle, `pedestrian_tracks_NNN.csv`, each plain or
compressed as `.csv.xz`. Source: INTERACTION dataset, "Details and Format".
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from data.formats.csv_table import one_of, read_table
from data.formats.ind_checks import SIZE_TOLERANCE, check_order, check_speed
from data.formats.motion import accelerations
from data.formats.road_users import check_size, class_of
from data.formats.time_step import check_time_step
from data.recording import PEDESTRIAN, Floats, Integers, Recording

if TYPE_CHECKING:
    import pandas as pd

ANYBODY = {
    "track_id": str,
    **dict.fromkeys(("frame_id", "timestamp_ms"), np.int64),
    "agent_type": str,
    **dict.fromkeys(("x", "y", "vx", "vy"), np.float64),
}
BODY = ("psi_rad", "length", "width")
VEHICLES = {**ANYBODY, **dict.fromkeys(BODY, np.float64)}
ON_FOOT_OR_BICYCLE = "pedestrian/bicycle"
CYCLES = 3.5  # [m/s], ours: who is faster half of the time cycles; people run slower across a street


class _Part(NamedTuple):
    """One file: its rows, the first row of each track and one more, each track's class, and its frames a second."""

    rows: pd.DataFrame
    offsets: Integers
    road_user: list[str]
    rate: float


def interaction_ids(folder: Path) -> list[str]:
    """The ids of the recordings in a folder, in order: ["000", "001", ...]; empty where there is none."""
    found = (re.fullmatch(r"vehicle_tracks_(\w+)\.csv(\.xz)?", path.name) for path in folder.iterdir())
    return sorted({match[1] for match in found if match})


def interaction_file(folder: Path, recording: str) -> Path:
    """The file of a recording's vehicles.

    Raises:
        FileNotFoundError: it is missing.
        ValueError: it is there twice, plain and compressed.
    """
    return one_of(folder, f"vehicle_tracks_{recording}.csv")


def read_interaction(folder: Path, recording: str) -> Recording:
    """The recording of that id ("000") in a folder, checked. It names no location.

    Raises:
        FileNotFoundError: its file is missing.
        ValueError: a file is malformed or contradicts itself; the message names file, row and column.
    """
    import pandas as pd  # 0.4 s to import

    path = interaction_file(folder, recording)
    parts = [_part(path, VEHICLES)]
    beside = f"pedestrian_tracks_{recording}.csv"
    if any((folder / name).is_file() for name in (beside, f"{beside}.xz")):
        parts.append(_part(one_of(folder, beside), ANYBODY))
        if parts[1].rate != parts[0].rate:
            rates = " and ".join(f"{part.rate:g}" for part in parts)
            raise ValueError(f"{path}: {rates} frames a second here and in {beside}; wanted the same")
    rows = pd.concat([part.rows for part in parts], ignore_index=True)
    offsets = np.concatenate([parts[0].offsets, *(part.offsets[1:] + len(parts[0].rows) for part in parts[1:])])
    first, velocity = rows.iloc[offsets[:-1]], rows[["vx", "vy"]].to_numpy()
    frame = rows["frame_id"].to_numpy()
    result = Recording(
        id=recording,
        location=None,
        frame_rate=parts[0].rate,
        track_id=first["track_id"].to_numpy().astype(np.str_),
        road_user=tuple(user for part in parts for user in part.road_user),
        length=first["length"].to_numpy(),
        width=first["width"].to_numpy(),
        offsets=offsets,
        frame=frame - frame.min(),
        x=rows["x"].to_numpy(),
        y=rows["y"].to_numpy(),
        velocity=velocity,
        acceleration=accelerations(velocity, offsets, parts[0].rate),
        heading=(rows["psi_rad"].to_numpy() + np.pi) % (2.0 * np.pi) - np.pi,
    )
    check_time_step(path, f"{1000.0 / result.frame_rate:g} ms a frame (timestamp_ms)", result)
    return result


def _part(path: Path, columns: dict[str, type]) -> _Part:
    rows = read_table(path, columns)
    track, frame = rows["track_id"].to_numpy().astype(np.str_), rows["frame_id"].to_numpy()
    offsets = np.flatnonzero(np.concatenate([[True], track[1:] != track[:-1], [True]]))
    check_order(path, track, frame, offsets)
    velocity = rows[["vx", "vy"]].to_numpy()
    check_speed(path, track, velocity, "vx, vy")
    rate = _rate(path, frame, rows["timestamp_ms"].to_numpy())
    rows = rows.assign(**{name: 0.0 for name in BODY if name not in rows})
    users = []
    for begin, end in pairwise(offsets):
        where = f"{path}, line {begin + 2}"
        user = _class(where, rows["agent_type"].iloc[begin], velocity[begin:end])
        sizes = rows[["length", "width"]].to_numpy()[begin:end]
        if (np.ptp(sizes, axis=0) > SIZE_TOLERANCE).any():
            raise ValueError(f"{where}: length or width of track {track[begin]} changes; wanted one size a track")
        check_size(f"{where}: track {track[begin]}", user, *sizes[0])
        users.append(user)
    return _Part(rows, offsets, users, rate)


def _class(where: str, word: str, velocity: Floats) -> str:
    """The class of a track; the format does not tell who walks from who cycles, so speeds do."""
    if word != ON_FOOT_OR_BICYCLE:
        return class_of(f"{where}: agent_type", word)
    return "bicycle" if np.median(np.hypot(*velocity.T)) > CYCLES else PEDESTRIAN


def _rate(path: Path, frame: Integers, milliseconds: Integers) -> float:
    """Frames a second, of which every row's time has to be."""
    first, last = int(frame.argmin()), int(frame.argmax())
    if first == last or frame[first] == frame[last]:
        raise ValueError(f"{path}: all rows are of frame {frame[first]}; wanted several")
    step = float(milliseconds[last] - milliseconds[first]) / float(frame[last] - frame[first])
    off = np.abs(milliseconds - milliseconds[first] - step * (frame - frame[first]))
    if not step > 0.0 or off.max() > 1.0:
        row = int(off.argmax())
        raise ValueError(
            f"{path}, line {row + 2}: timestamp_ms is {milliseconds[row]} at frame {frame[row]}, where frames of"
            f" {step:g} ms make it {milliseconds[row] - off[row]:g} or {milliseconds[row] + off[row]:g}"
        )
    return 1000.0 / step
