"""What the page asks for, checked: a traffic, and the priorities that are assigned in it."""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic
from intersection_env.viewer.recorded import scene_called

MOST_ID = 40  # characters of a vehicle's id
NUMBERS = ("position", "speed", "length", "width")
BUILDING = threading.Lock()  # Python's list of warnings is one for all threads


@dataclass(frozen=True)
class Asked:
    """A traffic, the priorities (pair,) that are assigned in it, and what is to be doubted about it, in words."""

    traffic: Traffic
    priorities: NDArray[np.int8]
    notes: tuple[str, ...]


def asked(intersection: Intersection, scenes: Scenes | None, request: Mapping[str, Any]) -> Asked:
    """The traffic of a request: `vehicles` as they are given, or those of a `scene` at a `step`.

    `assigned` are pairs (first, second) of ids; `priorities`, in their place, a whole order as a ranking has it: routes
    that meet twice may be passed first by one and then by the other.

    Raises:
        ValueError: something is missing or of another kind, or cannot be; the message names it.
    """
    with doubts() as found:
        is_given = "vehicles" in request
        traffic = _given(intersection, request["vehicles"]) if is_given else _recorded(scenes, request)
    return Asked(traffic, _priorities(traffic, request), tuple(str(doubt.message) for doubt in found))


@contextmanager
def doubts() -> Iterator[list[warnings.WarningMessage]]:
    """Takes the warnings of traffics that are built inside: they go to the page, not to the terminal."""
    with BUILDING, warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", UserWarning)
        yield found


def text(request: Mapping[str, Any], name: str) -> str:
    """A string of a request.

    Raises:
        ValueError: it is missing, or none.
    """
    value = request.get(name)
    if not isinstance(value, str):
        raise ValueError(f'"{name}" is {value!r}; wanted a string')
    return value


def whole(request: Mapping[str, Any], name: str) -> int:
    """A whole number of a request.

    Raises:
        ValueError: it is missing, or none.
    """
    value = request.get(name)
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError(f'"{name}" is {value!r}; wanted a whole number')
    return value


def _recorded(scenes: Scenes | None, request: Mapping[str, Any]) -> Traffic:
    if scenes is None:
        raise ValueError("nothing is recorded on this map: a request needs vehicles")
    return scenes.at(scene_called(scenes, text(request, "scene")), whole(request, "step") * DT)


def _given(intersection: Intersection, rows: object) -> Traffic:
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError('"vehicles" must be a list, one entry a vehicle')
    ids = tuple(text(row, "id") for row in rows)
    for one in ids:
        if not 0 < len(one) <= MOST_ID:
            raise ValueError(f"a vehicle's id has 1 to {MOST_ID} characters, not {len(one)}")
    columns: dict[str, Any] = {name: np.array([_number(row, name) for row in rows], np.float32) for name in NUMBERS}
    top = [np.inf if row.get("maxSpeed") is None else _number(row, "maxSpeed") for row in rows]
    route = np.array([intersection.route_index(text(row, "route")) for row in rows], np.int32)
    return Traffic(intersection, ids, route, **columns, max_speed=np.array(top, np.float32))


def _number(row: Mapping[str, Any], name: str) -> float:
    value = row.get(name)
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise ValueError(f'vehicle {row.get("id")}: "{name}" is {value!r}; wanted a number')
    return float(value)


def _priorities(traffic: Traffic, request: Mapping[str, Any]) -> NDArray[np.int8]:
    if "priorities" not in request:
        return traffic.assign(_pairs(request.get("assigned", [])))
    given, count = request["priorities"], len(traffic.conflicts)
    if not isinstance(given, list) or len(given) != count or any(one not in (-1, 0, 1) for one in given):
        raise ValueError(f'"priorities" must be {count} numbers, one an open conflict, each -1, 0 or 1')
    return np.array(given, np.int8)


def _pairs(pairs: object) -> tuple[tuple[str, str], ...]:
    if not isinstance(pairs, list):
        raise ValueError('"assigned" must be a list of pairs')
    for pair in pairs:
        if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(one, str) for one in pair):
            raise ValueError(f'"assigned" holds {pair!r}; wanted a pair of ids, who goes first and who second')
    return tuple((first, second) for first, second in pairs)
