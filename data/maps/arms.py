"""The arms of a junction: lanes that run side by side, in whichever direction, are one road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely
import shapely.ops

from data.maps.junction import Circle
from data.maps.lanelets import LaneMap
from data.maps.paths import Way

ROAD = 40.0  # [m], ours: lanes are compared so far from the junction
GAP = 4.0  # [m], ours: lanes nearer to each other are of one road; a wider island parts two
PARALLEL = np.radians(35.0)  # ours: lanes of one road differ by less
NAMES = ("E", "NE", "N", "NW", "W", "SW", "S", "SE")


@dataclass(frozen=True)
class ArmLanes:
    """One road that meets the junction.

    approaches, exits: the lanelet at the junction of each of its lanes, from right to left of who drives there.
    bearing: of the road seen from the junction's centre [rad].
    """

    name: str
    approaches: tuple[str, ...]
    exits: tuple[str, ...]
    bearing: float


@dataclass(frozen=True)
class _Lane:
    id: str
    is_exit: bool
    area: shapely.Geometry
    outward: complex
    """The direction away from the junction, of length 1."""
    mouth: complex
    """Its end at the junction [m]."""


def find_arms(lane_map: LaneMap, circle: Circle, ways: Sequence[Way]) -> list[ArmLanes]:
    """The arms, counter-clockwise from the east, named by where they lie."""
    lanes = [_lane(lane_map, chain, False) for chain in dict.fromkeys(way.approach for way in ways)]
    lanes += [_lane(lane_map, chain, True) for chain in dict.fromkeys(way.leaving for way in ways)]
    parent = list(range(len(lanes)))
    for one, other in combinations(range(len(lanes)), 2):
        if _side_by_side(lanes[one], lanes[other]):
            first, second = _root(parent, one), _root(parent, other)
            parent[max(first, second)] = min(first, second)
    groups: dict[int, list[_Lane]] = {}
    for number, lane in enumerate(lanes):
        groups.setdefault(_root(parent, number), []).append(lane)
    centre = complex(circle.x, circle.y)
    found = [(float(np.angle(np.mean([lane.mouth for lane in group]) - centre)), group) for group in groups.values()]
    arms: list[ArmLanes] = []
    for bearing, group in sorted(found, key=lambda item: (item[0] + np.pi / 8.0) % (2.0 * np.pi)):
        plain = NAMES[round(bearing / (np.pi / 4.0)) % 8]
        same = sum(arm.name.rstrip("0123456789") == plain for arm in arms)
        name = plain if not same else f"{plain}{same + 1}"
        outward = sum(lane.outward for lane in group)
        sides: list[tuple[str, ...]] = []
        for is_exit in (False, True):
            own = [lane for lane in group if lane.is_exit == is_exit]
            left = outward * 1j if is_exit else -outward * 1j
            sides.append(tuple(lane.id for lane in sorted(own, key=lambda lane: (lane.mouth * left.conjugate()).real)))
        arms.append(ArmLanes(name, sides[0], sides[1], bearing))
    return arms


def _lane(lane_map: LaneMap, chain: tuple[str, ...], is_exit: bool) -> _Lane:
    points = np.concatenate([lane_map.lanelets[id].centre()[0] for id in chain])
    outward = points if is_exit else points[::-1]
    line = shapely.LineString(outward)
    far = shapely.get_coordinates(shapely.line_interpolate_point(line, min(ROAD, line.length)))[0]
    way = complex(*(far - outward[0]))
    width = float(np.median(lane_map.lanelets[chain[0 if is_exit else -1]].centre()[1]))
    near = shapely.ops.substring(line, 0.0, min(ROAD, line.length))
    area = shapely.buffer(near, 0.5 * width, cap_style="flat")
    id = chain[0] if is_exit else chain[-1]
    return _Lane(id, is_exit, area, way / abs(way), complex(*outward[0]))


def _side_by_side(one: _Lane, other: _Lane) -> bool:
    parallel = abs(np.angle(one.outward * other.outward.conjugate())) < PARALLEL
    return bool(parallel and shapely.distance(one.area, other.area) < GAP)


def _root(parent: list[int], one: int) -> int:
    while parent[one] != one:
        one = parent[one]
    return one
