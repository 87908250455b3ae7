"""Painted stop lines that lie where the model can use them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from data.maps.lanelets import LaneMap
from data.maps.paths import Way
from data.maps.room import EARLIEST
from intersection_env.maps.compiler import encounters
from intersection_env.maps.curve import Points
from intersection_env.maps.source import MapSource

LONGER = 0.7  # [m], ours: a line is painted short of its lane's edges
AT_END = 1.0  # [m], ours: a line so near to the end of its lane says nothing new


def with_stop_lines(source: MapSource, lane_map: LaneMap, ways: Mapping[str, Way], guessed: list[str]) -> MapSource:
    """The source with the painted lines that every route of their lane crosses before its first conflict.

    ways: by route id. Lines that cannot be used are named in `guessed`.
    """
    for lane in dict.fromkeys(route.approach[-1] for route in source.routes):
        own = [ways[route.id] for route in source.routes if route.approach[-1] == lane]
        lines = [
            line
            for id in dict.fromkeys(id for way in own for id in (way.approach[-1], *way.inside))
            if (line := lane_map.lanelets[id].stop_line) is not None
        ]
        end = source.lanes[lane].points[-1]
        lines = [line for line in lines if np.linalg.norm(line.mean(axis=0) - end) > AT_END]
        for line in lines[::-1]:
            tried = replace(source, stop_lines=source.stop_lines | {lane: _longer(line)})
            if _is_sound(tried, lane):
                source = tried
                break
        else:
            if lines:
                guessed.append(
                    f'lane "{lane}": its painted stop line is not used, for routes miss it or conflict before'
                )
    return source


def _longer(line: Points) -> Points:
    way = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
    return np.array([line[0] - LONGER * way, line[-1] + LONGER * way])


def _is_sound(source: MapSource, lane: str) -> bool:
    try:
        found = encounters(source)
    except ValueError:
        return False
    sides = [(one.first, one.early[0]) for one in found] + [(one.second, one.early[1]) for one in found]
    return all(early <= EARLIEST for route, early in sides if route.approach[-1] == lane)
