"""The ways through a junction, lanelet by lanelet: those before it, inside it and behind it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.maps.junction import Circle
from data.maps.lanelets import LaneMap
from intersection_env.maps.curve import along, wrap

REACH = 200.0  # [m], ours: lanes that begin or end further from the junction's centre are not needed
LATE = 12.0  # [m], ours: a lane of its own that is shorter has no room for who waits there
MOST_INSIDE = 60  # ours: lanelets of one way through a junction; a ring has some twenty


@dataclass(frozen=True)
class Way:
    """One way through the junction; each part in driving order, `inside` may be empty of nothing but lanelets."""

    approach: tuple[str, ...]
    inside: tuple[str, ...]
    leaving: tuple[str, ...]


def find_paths(lane_map: LaneMap, circle: Circle, inside: set[str], left_out: Counter[str]) -> list[Way]:
    """A way for each pair of a lane before and a lane behind the junction: the shortest inside.

    Counted in `left_out`: longer ways between the same lanes, lanes that begin or end inside.

    Raises:
        ValueError: no way leads through.
    """
    before = lane_map.predecessors()
    length = {id: float(len(one.centre()[0])) for id, one in lane_map.lanelets.items()}
    starts = [id for id in lane_map.lanelets if id not in inside and set(lane_map.lanelets[id].successors) & inside]
    for id in sorted(inside):
        if not before[id]:
            left_out[f"lanelet {id} begins inside the junction"] += 1
        if not lane_map.lanelets[id].successors:
            left_out[f"lanelet {id} ends inside the junction"] += 1
    paths: list[Way] = []
    for start in starts:
        for end, way in _ways(lane_map, start, inside, length, left_out).items():
            paths.append(Way((start,), way, (end,)))
    if not paths:
        raise ValueError(f"no lane leads through the junction at {circle} from one side to another")
    approaches = _chains(lane_map, before, {path.approach[-1] for path in paths}, circle, inside, -1)
    exits = _chains(
        lane_map,
        {id: list(one.successors) for id, one in lane_map.lanelets.items()},
        {path.leaving[0] for path in paths},
        circle,
        inside,
        1,
    )
    whole = [replace(path, approach=approaches[path.approach[0]], leaving=exits[path.leaving[0]]) for path in paths]
    return _parted_inside(lane_map, whole)


def _parted_inside(lane_map: LaneMap, ways: Sequence[Way]) -> list[Way]:
    """The ways, where a lane that parts from another only just before the junction parts inside it instead."""
    found = []
    for way in ways:
        others = {id for other in ways if other.approach != way.approach for id in other.approach}
        own = [id for id in way.approach if id not in others]
        length = sum(float(along(lane_map.lanelets[id].centre()[0])[-1]) for id in own)
        if own and len(own) < len(way.approach) and length < LATE and way.approach[-len(own) :] == tuple(own):
            way = Way(way.approach[: -len(own)], (*own, *way.inside), way.leaving)
        found.append(way)
    return found


def _ways(
    lane_map: LaneMap, start: str, inside: set[str], length: Mapping[str, float], left_out: Counter[str]
) -> dict[str, tuple[str, ...]]:
    """By lanelet behind the junction, the shortest way there from `start`."""
    best: dict[str, tuple[float, tuple[str, ...]]] = {}
    open_: list[tuple[float, str, tuple[str, ...]]]
    open_ = [(0.0, one, ()) for one in lane_map.lanelets[start].successors if one in inside]
    while open_:
        far, one, way = open_.pop()
        if one not in inside:
            left_out["longer way between the same lanes"] += one in best
            if one not in best or far < best[one][0]:
                best[one] = far, way
            continue
        if one in way or len(way) > MOST_INSIDE:
            continue
        open_ += [(far + length[one], other, (*way, one)) for other in lane_map.lanelets[one].successors]
    return {one: way for one, (_, way) in best.items()}


def _chains(
    lane_map: LaneMap,
    edges: Mapping[str, list[str]],
    ends: set[str],
    circle: Circle,
    inside: set[str],
    sign: int,
) -> dict[str, tuple[str, ...]]:
    """By lanelet at the junction, the lanelets from or to the map's edge, the straightest on, in driving order."""
    chains: dict[str, tuple[str, ...]] = {}
    for end in ends:
        chain = [end]
        while True:
            following = [one for one in edges[chain[-1]] if one not in inside and one not in chain]
            following = [one for one in following if _near(lane_map, one, circle)]
            if not following:
                break
            last = chain[-1]
            chain.append(min(following, key=lambda one: (_bend(lane_map, last, one, sign), one)))
        chains[end] = tuple(chain[::sign])
    return chains


def _near(lane_map: LaneMap, id: str, circle: Circle) -> bool:
    points = lane_map.lanelets[id].centre()[0]
    return bool(np.linalg.norm(points - [circle.x, circle.y], axis=1).min() < REACH)


def _bend(lane_map: LaneMap, one: str, other: str, sign: int) -> float:
    """How far the heading in the middle of a lanelet differs from that of the next one [rad]."""
    headings = []
    for id in (one, other):
        points = lane_map.lanelets[id].centre()[0]
        east, north = points[-1] - points[0]
        headings.append(np.arctan2(north, east))
    return abs(wrap(headings[1] - headings[0]))
