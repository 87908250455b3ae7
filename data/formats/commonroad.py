"""Reads the obstacles of CommonRoad scenarios (XML of 2018b and 2020a, or protobuf) as recordings.

Scenarios are often windows cut out of one recording; those that follow each other are put together again. XML is not
read with commonroad-io: that truncates coordinates to four decimals. Source: CommonRoad, "XML scenario format".
"""

from __future__ import annotations

import re
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from data.formats.commonroad_obstacles import Obstacle, read_obstacle
from data.formats.commonroad_tree import PROTOBUF, XML, has_obstacles, read_tree
from data.formats.time_step import check_time_step
from data.formats.xml_tree import number, text_of
from data.recording import Floats, Recording

OBSTACLES = ("dynamicObstacle", "staticObstacle", "obstacle")
MEETS = 0.5  # [m], ours: a window goes on where another ends if all are so near to where their speeds lead them
GOING = 1.0  # [m/s], ours: who stands says nothing about time


class Scenario(NamedTuple):
    """One file: its time step [s], its obstacles by id, its last time step, and what was not read."""

    path: Path
    time_step: float
    obstacles: dict[str, Obstacle]
    last: int
    left_out: Counter[str]


def commonroad_runs(folder: Path) -> dict[str, list[Path]]:
    """By recording id, its scenarios: one, or several windows of one recording that follow each other.

    A recording is called like its first file. Maps and planning problems that are files of their own hold none.

    Raises:
        ValueError: a scenario is malformed, or holds no obstacle that moves.
    """
    found = [*folder.glob(f"*{XML}"), *folder.glob(f"*{PROTOBUF}")]
    paths = sorted(filter(has_obstacles, found), key=lambda path: _in_order(path.stem))
    if not paths:
        raise ValueError(f"{min(found)}: no obstacles here, nor in another file of this folder; wanted a scenario")
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
    root = read_tree(path)
    time_step = number(f"{path}: timeStepSize", root.get("timeStepSize"))
    if not 0.001 <= time_step <= 1.0:
        raise ValueError(f"{path}: timeStepSize is {time_step:g} s; wanted 0.001 to 1")
    left_out: Counter[str] = Counter()
    obstacles: dict[str, Obstacle] = {}
    found = [one for one in root if one.tag in OBSTACLES]
    standing = [one for one in found if one.tag == "staticObstacle" or text_of(one, "role") == "static"]
    for element in found:
        obstacle = None if element in standing else read_obstacle(path, element, left_out)
        if obstacle is not None:
            _add(path, obstacle, obstacles)
    if not obstacles:
        raise ValueError(f"{path}: no obstacle that moves ({len(standing)} that stand); wanted a scenario with traffic")
    last = int(max(one.states[-1, 0] for one in obstacles.values()))
    for element in standing:
        obstacle = read_obstacle(path, element, left_out)
        if obstacle is not None:  # it is there all along
            states = np.repeat(obstacle.states[:1], last + 1, axis=0)
            states[:, 0] = np.arange(last + 1)
            _add(path, obstacle._replace(states=states), obstacles)
    return Scenario(path, time_step, obstacles, last, left_out)


def _add(path: Path, obstacle: Obstacle, obstacles: dict[str, Obstacle]) -> None:
    if obstacle.id in obstacles:
        raise ValueError(f"{path}: obstacle {obstacle.id} is there twice")
    obstacles[obstacle.id] = obstacle


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
