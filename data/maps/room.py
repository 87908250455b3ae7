"""Room before the junction: approaches end where their first conflict begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from intersection_env.maps.compiler import encounters
from intersection_env.maps.curve import along
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import Lane

EARLIEST = 0.5  # [m], the compiler takes conflicts that begin so far before a stop line
ROOM = 0.3  # [m], ours: a lane that is cut back ends so far before its first conflict
LEAST_LANE = 2.0  # [m], ours: what is left of a lane that is cut back
ROUNDS = 4


def length_of(lane: Lane) -> float:
    """A lane's length [m]."""
    return float(along(lane.points)[-1])


def with_room(source: MapSource, guessed: list[str]) -> MapSource:
    """The source with approaches cut back where a conflict begins before their end."""
    first = source
    for _ in range(ROUNDS):
        back: dict[str, float] = {}
        for one in encounters(source):
            for route, early in zip((one.first, one.second), one.early, strict=True):
                if early > EARLIEST - 0.2:
                    back[route.approach[-1]] = max(back.get(route.approach[-1], 0.0), early + ROOM)
        if not back:
            break
        source = _cut_back(source, back)
    for name, lane in source.lanes.items():
        by = length_of(first.lanes[name]) - length_of(lane)
        if by > 0.1:
            guessed.append(f'lane "{name}": ends {by:.1f} m earlier than drawn, where its first conflict begins')
    return source


def _cut_back(source: MapSource, back: Mapping[str, float]) -> MapSource:
    """The lanes end so much earlier [m]; what is cut off goes to the ways inside."""
    lanes = dict(source.lanes)
    tails = {}
    for name, by in back.items():
        lanes[name], tails[name] = _shortened(name, lanes[name], by)
    routes = [
        replace(route, inside=np.concatenate([tails[route.approach[-1]].points[:-1], route.inside]))
        if route.approach[-1] in tails and route.inside is not None
        else route
        for route in source.routes
    ]
    return replace(source, lanes=lanes, routes=tuple(routes))


def _shortened(name: str, lane: Lane, by: float) -> tuple[Lane, Lane]:
    way = along(lane.points)
    at = way[-1] - by
    if at < LEAST_LANE:
        raise ValueError(
            f'lane "{name}" meets another {by:.1f} m before its end and is {way[-1]:.1f} m long; wanted room to wait:'
            " choose a smaller circle, or leave the lane out"
        )
    columns = np.column_stack([lane.points, lane.width])
    place = np.array([[np.interp(at, way, column) for column in columns.T]])
    one = np.concatenate([columns[way < at - 0.01], place])
    other = np.concatenate([place, columns[way > at + 0.01]])
    return Lane(one[:, :2], one[:, 2]), Lane(other[:, :2], other[:, 2])
