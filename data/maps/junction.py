"""Where lanelets cross or merge: which junctions a map holds, and which lanelets lie inside the chosen one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from data.maps.lanelets import Lanelet, LaneMap, RightOfWay
from intersection_env.maps.meeting import SWEPT_WIDTH

TOGETHER = 15.0  # [m], ours: crossings nearer to each other belong to one junction
MARGIN = 8.0  # [m], ours: a junction reaches so far beyond the outermost crossing
LONGEST_TAIL = 15.0  # [m], ours: a lanelet that goes on for longer before or behind its crossings is cut there
KEPT_TAIL = 1.0  # [m], ours: where it is cut, so far from the nearest crossing
LEAST_AREA = 0.05  # [m²], ours: bands that touch by less do not meet; the compiler's own bound
MOST_RADIUS = 500.0  # [m], ours: a larger circle is no junction


@dataclass(frozen=True)
class Circle:
    """A junction's place [m]."""

    x: float
    y: float
    radius: float

    def __str__(self) -> str:
        return f"{self.x:.0f},{self.y:.0f},{self.radius:.0f}"

    def disc(self) -> shapely.Polygon:
        """The area inside."""
        return shapely.Point(self.x, self.y).buffer(self.radius)


@dataclass(frozen=True)
class Meeting:
    """Two lanelets that cross or merge, and where: an area of the plane."""

    one: str
    other: str
    area: shapely.geometry.base.BaseGeometry


def meetings(lane_map: LaneMap) -> list[Meeting]:
    """All pairs of lanelets that cross or merge: bands two metres wide overlap, and neither leads into the other.

    Lanelets that begin where the same one ends part there, and do not meet.
    """
    ids = list(lane_map.lanelets)
    bands = {id: band(lane_map.lanelets[id]) for id in ids}
    before = {id: set(found) for id, found in lane_map.predecessors().items()}
    tree = shapely.STRtree(list(bands.values()))
    found = []
    for first, second in tree.query(list(bands.values()), predicate="intersects").T:
        one, other = ids[int(first)], ids[int(second)]
        if first >= second or one in before[other] or other in before[one] or before[one] & before[other]:
            continue
        area = bands[one].intersection(bands[other])
        if area.area > LEAST_AREA:
            found.append(Meeting(one, other, area))
    return found


def band(lanelet: Lanelet) -> shapely.geometry.base.BaseGeometry:
    """What a car sweeps along a lanelet's centreline."""
    return shapely.buffer(shapely.LineString(lanelet.centre()[0]), SWEPT_WIDTH / 2.0, cap_style="flat")


def junctions(found: Iterable[Meeting]) -> list[Circle]:
    """The junctions of a map, each a circle around crossings near each other; those of most crossings come first."""
    places = np.array([shapely.get_coordinates(one.area.centroid)[0] for one in found])
    if not len(places):
        return []
    clusters = shapely.get_parts(shapely.union_all(shapely.buffer(shapely.points(places), TOGETHER / 2.0)))
    circles = []
    for cluster in clusters:
        own = places[shapely.contains(cluster, shapely.points(places))]
        hull = shapely.minimum_bounding_circle(shapely.MultiPoint(own))
        centre = shapely.get_coordinates(shapely.centroid(hull))[0]
        radius = float(np.linalg.norm(own - centre, axis=1).max()) + MARGIN
        circles.append((len(own), Circle(float(centre[0]), float(centre[1]), radius)))
    return [circle for _, circle in sorted(circles, key=lambda one: -one[0])]


def chosen(circles: list[Circle], around: Circle | None) -> Circle:
    """The junction asked for, or the only one there is.

    Raises:
        ValueError: there is none, or several and none was asked for.
    """
    if around is not None:
        return around
    if not circles:
        raise ValueError("no lanes cross or merge on this map, so there is no junction to find")
    if len(circles) > 1:
        known = "; ".join(map(str, circles[:12]))
        raise ValueError(
            f"{len(circles)} junctions are on this map; give one by --around=x,y,radius: {known} (most crossings first)"
        )
    return circles[0]


def cut_at_junction(lane_map: LaneMap, circle: Circle) -> tuple[LaneMap, set[str]]:
    """The map with lanelets cut that reach far out of the junction, and the ids of those inside.

    Inside are those that meet others within the circle, and those between two of them.

    Raises:
        ValueError: nothing meets inside the circle.
    """
    disc = circle.disc()
    spans = _spans(lane_map, disc)
    if not spans:
        raise ValueError(f"no lanes cross or merge around {circle}")
    lanelets = dict(lane_map.lanelets)
    inside: set[str] = set()
    for id, (begin, end, length) in spans.items():
        middle = id
        if begin > LONGEST_TAIL:
            lanelets[id], lanelets[f"{id}+"] = lanelets[id].cut((begin - KEPT_TAIL) / length)
            middle, end, length = f"{id}+", end - begin + KEPT_TAIL, length - begin + KEPT_TAIL
        if length - end > LONGEST_TAIL:
            lanelets[middle], lanelets[f"{middle}+"] = lanelets[middle].cut((end + KEPT_TAIL) / length)
        inside.add(middle)
    cut = replace(lane_map, lanelets=lanelets, rights=[_with_parts(one, lanelets) for one in lane_map.rights])
    return cut, inside | _between(cut, inside, disc)


def _spans(lane_map: LaneMap, disc: shapely.Polygon) -> dict[str, tuple[float, float, float]]:
    """By lanelet that meets others in the circle: arc lengths of the first and last such place, and its length [m]."""
    spans: dict[str, tuple[float, float, float]] = {}
    for one in meetings(lane_map):
        places = shapely.get_coordinates(one.area.intersection(disc))
        if not len(places):
            continue
        for id in (one.one, one.other):
            line = shapely.LineString(lane_map.lanelets[id].centre()[0])
            at = np.asarray(shapely.line_locate_point(line, shapely.points(places)))
            before = spans.get(id, (np.inf, -np.inf, line.length))
            spans[id] = min(before[0], float(at.min())), max(before[1], float(at.max())), line.length
    return spans


def _with_parts(right: RightOfWay, lanelets: dict[str, Lanelet]) -> RightOfWay:
    """The same rule for the parts of lanelets that were cut."""
    whole = {id: id.rstrip("+") for id in lanelets}
    yields, prior = (
        frozenset(id for id, one in whole.items() if one in group) for group in (right.yields, right.prior)
    )
    return replace(right, yields=yields, prior=prior)


def _between(lane_map: LaneMap, inside: set[str], disc: shapely.Polygon) -> set[str]:
    """Lanelets of the circle that are reached from inside and lead there."""
    before = lane_map.predecessors()
    near = {id for id, one in lane_map.lanelets.items() if disc.intersects(shapely.LineString(one.centre()[0]))}
    behind = _reached(inside, {id: list(one.successors) for id, one in lane_map.lanelets.items()}, near)
    ahead = _reached(inside, before, near)
    return behind & ahead


def _reached(start: set[str], edges: dict[str, list[str]], within: set[str]) -> set[str]:
    found: set[str] = set()
    open_ = [other for one in start for other in edges[one]]
    while open_:
        one = open_.pop()
        if one in within and one not in found:
            found.add(one)
            open_ += edges[one]
    return found
