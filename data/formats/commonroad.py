"""Reads the obstacles of CommonRoad scenarios (XML, 2018b and 2020a) as recordings.

Scenarios are often windows cut out of one recording; those that follow each other are put together again. Read as XML,
not with commonroad-io: that truncates coordinates to four decimals. Source: CommonRoad, "XML scenario format".
"""

from __future__ import annotations

import re
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from data.formats.commonroad_shape import Shape, shape_of
from data.formats.road_users import CLASSES, check_size
from data.formats.time_step import check_time_step
from data.formats.xml_tree import number, read_xml, text_of
from data.recording import Floats, Recording
from intersection_env import _core

TYPES = {**CLASSES, "priorityVehicle": "car", "parkedVehicle": "car", "train": "truck_bus"}
OBSTACLES = ("dynamicObstacle", "staticObstacle", "obstacle")
UNSIZED = ("pedestrian", "bicycle")
MEETS = 0.5  # [m], ours: a window goes on where another ends if all are so near to where their speeds lead them
GOING = 1.0  # [m/s], ours: who stands says nothing about time


class Obstacle(NamedTuple):
    """A road user of a scenario; states: (state, 6): time step, x, y [m], heading [rad], speed [m/s], m/s²."""

    id: str
    road_user: str
    shape: Shape
    states: Floats


class Scenario(NamedTuple):
    """One file: its time step [s], its obstacles by id, its last time step, and what was not read."""

    path: Path
    time_step: float
    obstacles: dict[str, Obstacle]
    last: int
    left_out: Counter[str]


def commonroad_runs(folder: Path) -> dict[str, list[Path]]:
    """By recording id, its scenarios: one, or several windows of one recording that follow each other.

    A recording is called like its first file.

    Raises:
        ValueError: a scenario is malformed, or holds no obstacle that moves.
    """
    paths = sorted(folder.glob("*.xml"), key=lambda path: _in_order(path.stem))
    runs: dict[str, list[Path]] = {}
    last: Scenario | None = None
    for path in paths:
        here = _scenario(path, path.stat().st_mtime_ns)
        if last is not None and _follows(last, here):
            runs[next(reversed(runs))].append(path)
        else:
            runs[path.stem] = [path]
        last = here
    return runs


def read_commonroad(paths: list[Path]) -> Recording:
    """The recording that scenarios hold which follow each other. It names no location.

    Raises:
        ValueError: a scenario is malformed or contradicts itself; the message names file and obstacle.
    """
    scenarios = [_scenario(path, path.stat().st_mtime_ns) for path in paths]
    who, tracks = _tracks(scenarios)
    rows = np.concatenate([part for _, part in tracks])
    frame, x, y, heading, speed, acceleration = rows.T
    direction = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    seen = Counter[str]()
    names = []
    for id, _ in tracks:
        seen[id] += 1
        names.append(id if seen[id] == 1 else f"{id}.{seen[id]}")
    result = Recording(
        id=paths[0].stem,
        location=None,
        frame_rate=1.0 / scenarios[0].time_step,
        track_id=np.array(names),
        road_user=tuple(who[id].road_user for id, _ in tracks),
        length=np.array([who[id].shape.length for id, _ in tracks]),
        width=np.array([who[id].shape.width for id, _ in tracks]),
        offsets=np.cumsum([0, *(len(part) for _, part in tracks)]),
        frame=frame.astype(np.int64),
        x=x,
        y=y,
        velocity=speed[:, None] * direction,
        acceleration=acceleration[:, None] * direction,
        heading=(heading + np.pi) % (2.0 * np.pi) - np.pi,
        left_out=sum((one.left_out for one in scenarios), Counter()),
    )
    check_time_step(paths[0], f"timeStepSize {scenarios[0].time_step:g}", result)
    return result


def _tracks(scenarios: list[Scenario]) -> tuple[dict[str, Obstacle], list[tuple[str, Floats]]]:
    """The obstacles of all windows by id, and each stretch that one is there, in time steps of the first window."""
    states: dict[str, list[Floats]] = {}
    who: dict[str, Obstacle] = {}
    first = 0
    for one in scenarios:
        for id, obstacle in one.obstacles.items():
            who.setdefault(id, obstacle)
            states.setdefault(id, []).append(obstacle.states + np.array([first, 0.0, 0.0, 0.0, 0.0, 0.0]))
        first += one.last + 1
    tracks = [(id, part) for id, parts in states.items() for part in _unbroken(np.concatenate(parts))]
    return who, sorted(tracks, key=lambda track: float(track[1][0, 0]))


@lru_cache(maxsize=4096)
def _scenario(path: Path, _changed: int) -> Scenario:
    """A file's scenario, read once as long as it stays unchanged."""
    root = read_xml(path, "commonRoad")
    time_step = number(f"{path}: timeStepSize", root.get("timeStepSize"))
    if not 0.001 <= time_step <= 1.0:
        raise ValueError(f"{path}: timeStepSize is {time_step:g} s; wanted 0.001 to 1")
    left_out: Counter[str] = Counter()
    obstacles: dict[str, Obstacle] = {}
    found = [one for one in root if one.tag in OBSTACLES]
    standing = [one for one in found if one.tag == "staticObstacle" or text_of(one, "role") == "static"]
    for element in found:
        obstacle = None if element in standing else _obstacle(path, element, left_out)
        if obstacle is not None and obstacle.id in obstacles:
            raise ValueError(f"{path}: obstacle {obstacle.id} is there twice")
        if obstacle is not None:
            obstacles[obstacle.id] = obstacle
    if not obstacles:
        raise ValueError(f"{path}: no obstacle that moves ({len(standing)} that stand); wanted a scenario with traffic")
    last = int(max(one.states[-1, 0] for one in obstacles.values()))
    for element in standing:
        obstacle = _obstacle(path, element, left_out)
        if obstacle is not None:  # it is there all along
            states = np.repeat(obstacle.states[:1], last + 1, axis=0)
            states[:, 0] = np.arange(last + 1)
            obstacles[obstacle.id] = obstacle._replace(states=states)
    return Scenario(path, time_step, obstacles, last, left_out)


def _obstacle(path: Path, element: Element, left_out: Counter[str]) -> Obstacle | None:
    """An obstacle with the states that the file has of it; None, and counted, where it is no road user."""
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
    initial = element.find("initialState")
    elements = [*([] if initial is None else [initial]), *element.findall("trajectory/state")]
    if not elements:
        raise ValueError(f"{where}: no initialState and no trajectory; wanted its states")
    states = np.array([_state(where, one, shape) for one in elements])
    step = np.diff(states[:, 0])
    if (step != 1.0).any():
        at = int(np.argmax(step != 1.0))
        raise ValueError(
            f"{where}: time step {states[at + 1, 0]:g} follows {states[at, 0]:g}; wanted each once, in order"
        )
    if (np.abs(states[:, 4]) > _core.MOST_SPEED).any():
        raise ValueError(f"{where}: a speed of {np.abs(states[:, 4]).max():g} m/s; wanted at most {_core.MOST_SPEED:g}")
    return Obstacle(id, user, shape, states)


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


def _in_order(name: str) -> list[tuple[int, str]]:
    """A key that sorts names by the numbers in them: T-80 before T-160."""
    return [(int(one), "") if one.isdecimal() else (0, one) for one in re.split(r"(\d+)", name)]


def _follows(before: Scenario, after: Scenario) -> bool:
    """Whether a scenario begins one time step after the end of another, by those who drive in both."""
    if before.time_step != after.time_step:
        return False
    missed = []
    for id in before.obstacles.keys() & after.obstacles.keys():
        one, other = before.obstacles[id].states[-1], after.obstacles[id].states[0]
        if one[0] == before.last and other[0] == 0.0 and min(one[4], other[4]) > GOING:
            way = 0.5 * (one[4] + other[4]) * before.time_step
            missed.append(abs(float(np.hypot(*(other[1:3] - one[1:3]))) - way))
    return bool(missed) and max(missed) < MEETS


def _unbroken(states: Floats) -> list[Floats]:
    """An obstacle's states, parted where it is away for a while."""
    return np.split(states, np.flatnonzero(np.diff(states[:, 0]) != 1.0) + 1)
