"""A junction of our own, as lanelets, written in Lanelet2's and CommonRoad's formats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from data.maps.utm import utm, zone_of
from intersection_env.maps.curve import Points, connect

WIDTH = 3.5
LENGTH = 70.0
"""[m] of each lane outside the junction."""
ARMS = {"E": 0.0, "N": 0.5 * np.pi, "W": np.pi, "S": -0.5 * np.pi}
PLACE = (49.5, 8.4)
"""[degrees]: somewhere; nothing is there."""


@dataclass(frozen=True)
class Drawn:
    """One lanelet: its centreline, the ids that follow, and what its format says of it."""

    id: int
    centre: Points
    successors: tuple[int, ...] = ()
    kind: str = "urban"
    signs: tuple[str, ...] = ()
    width: float = WIDTH

    def bounds(self) -> tuple[Points, Points]:
        """Left and right."""
        way = np.gradient(self.centre, axis=0)
        way /= np.linalg.norm(way, axis=1)[:, None]
        left = np.stack([-way[:, 1], way[:, 0]], axis=1)
        return self.centre + 0.5 * self.width * left, self.centre - 0.5 * self.width * left


@dataclass(frozen=True)
class Rule:
    """A right-of-way element: `yields` wait for `prior`, at a line where `line` is one."""

    yields: tuple[int, ...]
    prior: tuple[int, ...]
    line: tuple[tuple[float, float], tuple[float, float]] | None = None


@dataclass(frozen=True)
class Junction:
    """Lanelets and rules."""

    lanelets: dict[int, Drawn]
    rules: list[Rule] = field(default_factory=list)

    def moved(self, east: float, north: float) -> Junction:
        """The same elsewhere."""
        return replace(
            self,
            lanelets={
                id: replace(one, centre=one.centre + np.array([east, north])) for id, one in self.lanelets.items()
            },
        )

    def changed(self, id: int, **how: Any) -> Junction:
        """The same with one lanelet changed."""
        return replace(self, lanelets=self.lanelets | {id: replace(self.lanelets[id], **how)})


def into(arm: str, lane: int = 0) -> int:
    """The id of the lanelet that leads to the junction, `lane` counted from the middle of the road."""
    return 100 + 10 * list(ARMS).index(arm) + lane


def out_of(arm: str, lane: int = 0) -> int:
    """The id of the lanelet that leads away."""
    return 200 + 10 * list(ARMS).index(arm) + lane


def junction(arms: Sequence[str] = tuple(ARMS), mouth: float = 12.0, main_lanes: int = 1) -> Junction:
    """Arms that meet in 0, 0, all ways driven through; east and west have so many lanes each way.

    Who turns, uses the lane on that side; of two lanes each leads straight into its own.
    """
    found: dict[int, Drawn] = {}
    ends: dict[int, tuple[str, int]] = {}
    for arm in arms:
        out = np.array([np.cos(ARMS[arm]), np.sin(ARMS[arm])])
        left = np.array([-out[1], out[0]])
        for lane in range(main_lanes if arm in "EW" else 1):
            beside = (lane + 0.5) * WIDTH * left
            line = np.linspace(mouth, mouth + LENGTH, 8)[:, None] * out
            found[into(arm, lane)] = Drawn(into(arm, lane), (line + beside)[::-1])
            found[out_of(arm, lane)] = Drawn(out_of(arm, lane), line - beside)
            ends[into(arm, lane)] = arm, lane
    for id, (arm, lane) in ends.items():
        for other in arms:
            turn = (ARMS[other] - ARMS[arm]) % (2.0 * np.pi) / (0.5 * np.pi)  # 1: right, 2: straight, 3: left
            if other == arm:
                continue
            lanes = main_lanes if arm in "EW" else 1
            wanted = {1: lanes - 1, 3: 0}.get(round(turn), lane)
            if lane != wanted:
                continue
            target = out_of(other, min(lane, (main_lanes if other in "EW" else 1) - 1))
            inside = 1000 + 10 * (id - 100) + list(ARMS).index(other)
            curve = connect(found[id].centre, found[target].centre)
            curve = curve[np.r_[True, np.linalg.norm(np.diff(curve, axis=0), axis=1) > 1e-6]]
            found[inside] = Drawn(inside, curve, (target,))
            found[id] = replace(found[id], successors=(*found[id].successors, inside))
    return Junction(found)


def write_commonroad_map(path: Path, drawn: Junction) -> None:
    """A CommonRoad map; rules are not in the format."""
    signs = sorted({sign for one in drawn.lanelets.values() for sign in one.signs})
    parts = []
    for one in drawn.lanelets.values():
        left, right = one.bounds()
        parts.append(
            f'<lanelet id="{one.id}"><leftBound>{_points(left)}</leftBound><rightBound>{_points(right)}</rightBound>'
            + "".join(f'<successor ref="{other}"/>' for other in one.successors)
            + f"<laneletType>{one.kind}</laneletType>"
            + "".join(f'<trafficSignRef ref="{9000 + signs.index(sign)}"/>' for sign in one.signs)
            + "</lanelet>"
        )
    for sign in signs:
        kind, _, value = sign.partition("=")
        more = f"<additionalValue>{value}</additionalValue>" if value else ""
        element = f"<trafficSignElement><trafficSignID>{kind}</trafficSignID>{more}</trafficSignElement>"
        parts.append(f'<trafficSign id="{9000 + signs.index(sign)}">{element}</trafficSign>')
    path.write_text(f'<commonRoad commonRoadVersion="2020a" timeStepSize="0.1">{"".join(parts)}</commonRoad>\n')


def _points(points: Points) -> str:
    return "".join(f"<point><x>{x:.4f}</x><y>{y:.4f}</y></point>" for x, y in points)


def origin() -> tuple[float, float]:
    """The UTM metres of 0, 0 in the files of `write_lanelet2_map`."""
    east, north = utm(np.array([PLACE[0]]), np.array([PLACE[1]]), zone_of(PLACE[1]))[0]
    return float(east), float(north)


def degrees(points: Points, place: tuple[float, float] = PLACE) -> Points:
    """Latitude and longitude (point, 2) of local metres, by Newton's method."""
    zone = zone_of(place[1])
    zero = utm(np.array([place[0]]), np.array([place[1]]), zone)[0]
    found = np.tile(np.array(place), (len(points), 1))
    for _ in range(6):
        here = utm(found[:, 0], found[:, 1], zone)
        step = 1e-6
        by_latitude = (utm(found[:, 0] + step, found[:, 1], zone) - here) / step
        by_longitude = (utm(found[:, 0], found[:, 1] + step, zone) - here) / step
        slope = np.stack([by_latitude, by_longitude], axis=2)
        found = found + np.linalg.solve(slope, (points + zero - here)[:, :, None])[:, :, 0]
    return found


def write_lanelet2_map(path: Path, drawn: Junction, place: tuple[float, float] = PLACE) -> None:
    """A Lanelet2 map; lanelets share no ways, their ends lie on each other. Signs are those of `speed_limit`."""
    nodes: list[str] = []
    ways: list[str] = []
    relations: list[str] = []

    def way(points: Points) -> int:
        id = 50_000 + len(ways)
        refs = []
        for lat, lon in degrees(points, place):
            refs.append(1 + len(nodes))
            nodes.append(f'<node id="{1 + len(nodes)}" lat="{lat:.11f}" lon="{lon:.11f}"/>')
        ways.append(f'<way id="{id}">{"".join(f"<nd ref={chr(34)}{ref}{chr(34)}/>" for ref in refs)}</way>')
        return id

    for one in drawn.lanelets.values():
        left, right = one.bounds()
        subtype = {"urban": "road"}.get(one.kind, one.kind)
        limits = [sign.partition("=")[2] for sign in one.signs if sign.startswith("speed_limit=")]
        more = f'<tag k="speed_limit" v="{limits[0]}"/>' if limits else ""
        relations.append(
            f'<relation id="{one.id}"><member type="way" role="left" ref="{way(left)}"/>'
            f'<member type="way" role="right" ref="{way(right[::-1])}"/>'
            f'<tag k="type" v="lanelet"/><tag k="subtype" v="{subtype}"/><tag k="one_way" v="yes"/>{more}</relation>'
        )
    for number, rule in enumerate(drawn.rules):
        members = "".join(f'<member type="relation" role="yield" ref="{id}"/>' for id in rule.yields)
        members += "".join(f'<member type="relation" role="right_of_way" ref="{id}"/>' for id in rule.prior)
        if rule.line is not None:
            members += f'<member type="way" role="ref_line" ref="{way(np.array(rule.line))}"/>'
        kind = '<tag k="type" v="regulatory_element"/><tag k="subtype" v="right_of_way"/>'
        relations.append(f'<relation id="{70_000 + number}">{members}{kind}</relation>')
    path.write_text(f'<osm version="0.6">{"".join(nodes + ways + relations)}</osm>\n')
