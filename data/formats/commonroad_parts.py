"""Reads a CommonRoad file in protobuf as its message, and tells what it holds: such files have no name of their kind.

Each kind is tried: a file is one if it can be read as one and has the fields that others cannot have.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from google.protobuf.message import DecodeError

from data.formats.commonroad_messages import ONE_FILE, THREE_FILES, classes

SCENARIO, MAP, DYNAMIC, PROBLEMS = "scenario", "map", "dynamic part", "planning problems"
KINDS = {
    SCENARIO: ("CommonRoad", ("information.time_step_size",)),
    MAP: ("CommonRoadMap", ("map_meta_information.map_id.country_id", "location")),
    DYNAMIC: ("CommonRoadDynamic", ("dynamic_meta_information.time_step_size", "environment")),
    PROBLEMS: ("CommonRoadScenario", ("scenario_meta_information.time_step_size", "map_id")),
}
"""By what a file may hold, its message, and the fields by which it is known."""


class Part(NamedTuple):
    """A file's message, and what it holds: a whole scenario, or a part of one."""

    holds: str
    message: Any


def read_part(path: Path) -> Part:
    """A file's message, with all that has to be there.

    Raises:
        ValueError: the file is no CommonRoad file, is truncated, or lacks something; the message names it.
        OSError: the file cannot be read.
    """
    content = path.read_bytes()
    for holds, (name, known_by) in KINDS.items():
        message = _classes(holds == SCENARIO)[name]()
        try:
            message.ParseFromString(content)
        except DecodeError:
            continue
        if not all(_has(message, field) for field in known_by):
            continue
        missing = message.FindInitializationErrors()
        if missing:
            more = f", as {len(missing) - 1} more" if len(missing) > 1 else ""
            raise ValueError(f"{path}: {missing[0]} is missing{more}; wanted a complete {holds} (CommonRoad)")
        return Part(holds, message)
    raise ValueError(
        f"{path}: not CommonRoad's protobuf, or truncated; wanted a scenario, or one's map, dynamic part or planning"
        " problems"
    )


@cache
def _classes(one_file: bool) -> dict[str, Any]:
    return classes("one_file", ONE_FILE) if one_file else classes("three_files", THREE_FILES)


def _has(message: Any, field: str) -> bool:
    """Whether a field is there, or one in a field: "location", "information.time_step_size"."""
    name, _, rest = field.partition(".")
    return message.HasField(name) and (not rest or _has(getattr(message, name), rest))
