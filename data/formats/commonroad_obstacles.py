"""Reads one obstacle of a CommonRoad scenario, with its states."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from data.formats.commonroad_shape import Shape, shape_of
from data.formats.road_users import CLASSES, check_size
from data.formats.xml_tree import FARTHEST, number, text_of
from data.recording import Floats
from intersection_env import _core

TYPES = {**CLASSES, "priorityVehicle": "car", "parkedVehicle": "car", "train": "truck_bus"}
UNSIZED = ("pedestrian", "bicycle")
PREDICTED = ("occupancySet", "probabilityDistribution")
"""What an obstacle may have instead of a trajectory."""
MOST_STEPS = 1_000_000  # ours: hours of recording


class Obstacle(NamedTuple):
    """A road user of a scenario; states: (state, 6): time step, x, y [m], heading [rad], speed [m/s], m/s²."""

    id: str
    road_user: str
    shape: Shape
    states: Floats


def read_obstacle(path: Path, element: Element, left_out: Counter[str]) -> Obstacle | None:
    """An obstacle with the states that the file has of it; None, and counted, where it is no road user.

    Raises:
        ValueError: it is malformed, or predicted, not recorded; the message names file and obstacle.
    """
    id = element.get("id", "")
    where = f"{path}: obstacle {id}"
    word = text_of(element, "type") or ""
    if word not in TYPES:
        left_out[f'obstacle of type "{word}"'] += 1
        return None
    user = TYPES[word]
    shape = shape_of(where, element.find("shape"))
    if user in UNSIZED:
        shape = shape._replace(length=0.0, width=0.0)
    check_size(f"{path}: obstacle {id}", user, shape.length, shape.width)
    for tag in PREDICTED:
        if element.find(tag) is not None:
            raise ValueError(f"{where}: {tag}, which is a prediction; wanted the trajectory that was recorded")
    initial = element.find("initialState")
    elements = [*([] if initial is None else [initial]), *element.findall("trajectory/state")]
    if not elements:
        raise ValueError(f"{where}: no initialState and no trajectory; wanted its states")
    states = np.array([_state(where, one, shape) for one in elements])
    _check_states(where, states)
    return Obstacle(id, user, shape, states)


def _check_states(where: str, states: Floats) -> None:
    """Refuses states that no recording has, as damaged files do."""
    time, speed = states[:, 0], np.abs(states[:, 4])
    wrong = np.flatnonzero((time < 0.0) | (time > MOST_STEPS) | (time != np.rint(time)))
    if len(wrong):
        raise ValueError(f"{where}: time step {time[wrong[0]]:g}; wanted a whole number from 0 to {MOST_STEPS}")
    step = np.diff(time)
    if (step != 1.0).any():
        at = int(np.argmax(step != 1.0))
        raise ValueError(f"{where}: time step {time[at + 1]:g} follows {time[at]:g}; wanted each once, in order")
    if (speed > _core.MOST_SPEED).any():
        raise ValueError(f"{where}: a speed of {speed.max():g} m/s; wanted at most {_core.MOST_SPEED:g}")
    far = np.abs(states[:, 1:3]).max()
    if far > FARTHEST:
        raise ValueError(f"{where}: a position {far:g} m from 0; wanted at most {FARTHEST:g}")


def _state(where: str, element: Element, shape: Shape) -> list[float]:
    time = _value(where, element, "time")
    where = f"{where}, time step {time:g}"
    heading = _value(where, element, "orientation")
    point = element.find("position/point")
    if point is None:
        raise ValueError(f"{where}: no position/point; wanted an exact position")
    x, y = (number(f"{where}, position", text_of(point, axis)) for axis in ("x", "y"))
    speed = _value(where, element, "velocity")
    acceleration = 0.0 if element.find("acceleration") is None else _value(where, element, "acceleration")
    ahead, left = shape.centre
    return [
        time,
        x + ahead * np.cos(heading) - left * np.sin(heading),
        y + ahead * np.sin(heading) + left * np.cos(heading),
        heading,
        speed,
        acceleration,
    ]


def _value(where: str, element: Element, name: str) -> float:
    """A state's exact value, or the middle of its interval."""
    exact = text_of(element, f"{name}/exact")
    if exact is not None:
        return number(f"{where}, {name}", exact)
    ends = [text_of(element, f"{name}/interval{end}") for end in ("Start", "End")]
    return 0.5 * sum(number(f"{where}, {name}", end) for end in ends)
