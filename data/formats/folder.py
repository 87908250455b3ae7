"""A folder of recordings, whichever format they are in."""

from __future__ import annotations

import re
from pathlib import Path

from data.formats import ind
from data.formats.commonroad import commonroad_runs, read_commonroad
from data.formats.interaction import interaction_file, interaction_ids, read_interaction
from data.recording import Recording

IND, INTERACTION, COMMONROAD, PROTOBUF = "inD", "INTERACTION", "CommonRoad", "CommonRoad in protobuf"
FILES = {
    IND: r"\d+_tracks\.csv(\.xz)?",
    INTERACTION: r"vehicle_tracks_\w+\.csv(\.xz)?",
    COMMONROAD: r".+\.xml",
    PROTOBUF: r".+\.pb",
}
"""What the file of a recording is called."""


def format_of(folder: Path) -> str:
    """Which format the recordings in a folder are in, by the names of its files.

    Raises:
        FileNotFoundError: there is no such folder, or no recording in it.
        ValueError: recordings of several formats lie there.
    """
    wanted = "wanted NN_tracks.csv (inD), vehicle_tracks_NNN.csv (INTERACTION) or scenarios, *.xml or *.pb (CommonRoad)"
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; {wanted}")
    names = sorted(path.name for path in folder.iterdir())
    found = {one: name for one, pattern in FILES.items() for name in names if re.fullmatch(pattern, name)}
    if not found:
        raise FileNotFoundError(f"{folder}: no recording here; {wanted}")
    if len(found) > 1:
        there = ", ".join(f"{name} ({one})" for one, name in found.items())
        raise ValueError(f"{folder}: recordings of several formats: {there}; give each a folder of its own")
    return next(iter(found))


def recording_ids(folder: Path) -> list[str]:
    """The ids of the recordings in a folder, in order.

    Raises:
        FileNotFoundError, ValueError: as `format_of`; two recordings of inD have equal numbers, as 7 and 07; a
            scenario of CommonRoad is malformed.
    """
    match format_of(folder):
        case "inD":
            return ind.recording_ids(folder)
        case "INTERACTION":
            return interaction_ids(folder)
        case _:
            return list(commonroad_runs(folder))


def read_location(folder: Path, recording: str) -> int | None:
    """inD's location id of a recording; None where the format names no location.

    Raises:
        FileNotFoundError, ValueError: as `read_recording`.
    """
    return ind.read_location(folder, recording) if format_of(folder) == IND else None


def recording_file(folder: Path, recording: str) -> Path:
    """The file of a recording's tracks; of several scenarios that follow each other the first.

    Raises:
        FileNotFoundError, ValueError: as `read_recording`.
    """
    match format_of(folder):
        case "inD":
            return ind.recording_files(folder, recording).tracks
        case "INTERACTION":
            return interaction_file(folder, recording)
        case _:
            return commonroad_runs(folder)[recording][0]


def read_recording(folder: Path, recording: str) -> Recording:
    """The recording of that id in a folder, checked.

    Raises:
        FileNotFoundError: one of its files is missing.
        ValueError: a file is malformed or contradicts another; the message names file and place.
    """
    match format_of(folder):
        case "inD":
            return ind.read_recording(folder, recording)
        case "INTERACTION":
            return read_interaction(folder, recording)
        case _:
            return read_commonroad(commonroad_runs(folder)[recording])
