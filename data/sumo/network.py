"""The SUMO network on a map's own geometry.

The network is written as SUMO reads it, not through netconvert: netconvert cuts lanes where its own
idea of the junction begins, while drivers here wait at the map's stop lines, some of which lie well
inside the junction. Every lane ends at its stop line, every link carries the curve of our route from
there to its exit lane, and who yields to whom is taken from the compiled map.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data.sumo.places import BENDPLATZ
from intersection_env.maps.compiler import compile_file
from intersection_env.maps.curve import Points, along
from intersection_env.maps.source import MapSource, Piece
from intersection_env.maps.source_entries import RouteSource

CENTRE = "centre"
CORNERING = {"taxi": 1.4, "hov": 2.0, "evehicle": 2.6, "custom1": 3.2, "custom2": 4.0}
"""[m/s^2] ours: a driver takes a turn at the speed that needs this much sideways. SUMO knows speeds of a lane by class
of vehicle alone, so those who corner alike are a class, whatever its name."""
TURN_ACCELERATION = CORNERING["evehicle"]
SHIFT_ACCELERATION = 6.0  # [m/s^2], ours: more, since a driver straightens the drawn way into a pocket
CURVATURE_WINDOW = 3.0  # [m], ours: a bend is felt over this length
STANDOFF = 0.7  # [m], ours: SUMO's vehicles stand at the very end of a lane, real ones a little before the line
VISIBILITY = {"priority": 40.0, "yield": 15.0, "stop": 15.0}  # [m], ours: gave realistic approaches
LINK_STATE = {"priority": "M", "yield": "m", "stop": "s"}
DIRECTION = {"straight": "s", "left": "l", "right": "r"}


@dataclass(frozen=True)
class Path2D:
    """A route's centreline by arc length, and where its marks lie [m]."""

    id: str
    points: Points
    arc: NDArray[np.float64]
    stop_line: float
    junction_end: float

    def between(self, begin: float, end: float) -> Points:
        """The centreline from one arc length to another: (point, 2) [m]."""
        inner = self.arc[(self.arc > begin + 1e-6) & (self.arc < end - 1e-6)]
        return self.at(np.concatenate([[begin], inner, [end]]))

    def at(self, arc: NDArray[np.float64]) -> Points:
        """The points at these arc lengths; beyond an end the route runs on straight. (n,) -> (n, 2) [m]."""
        inside = np.clip(arc, 0.0, self.arc[-1])
        points = np.stack([np.interp(inside, self.arc, self.points[:, axis]) for axis in (0, 1)], axis=1)
        first, last = self.points[1] - self.points[0], self.points[-1] - self.points[-2]
        outward = np.where(arc[:, None] < 0.0, first / np.linalg.norm(first), last / np.linalg.norm(last))
        return np.asarray(points + (arc - inside)[:, None] * outward)

    def heading(self, arc: NDArray[np.float64]) -> NDArray[np.float64]:
        """The direction of travel at these arc lengths, over two metres [rad], unwrapped."""
        step = self.at(arc + 1.0) - self.at(arc - 1.0)
        return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


@dataclass
class Edge:
    """A lane of the map, up to its stop line; shape (point, 2) [m]."""

    shape: Points
    speed: float
    begin_node: str = ""
    end_node: str = ""


@dataclass(frozen=True)
class Link:
    """The way from one lane to the next across a node; shape (point, 2) [m], speed [m/s]."""

    before: str
    after: str
    node: str
    shape: Points
    speed: float
    direction: str = "s"
    state: str = "M"
    visibility: float = 100.0
    speeds: dict[str, float] = field(default_factory=dict)
    """By class of vehicle [m/s]; others drive at `speed`."""


@dataclass
class Network:
    """What SUMO drives on, and how to get back from its lanes to arc lengths on our routes."""

    paths: dict[str, Path2D]
    edges: dict[str, Edge] = field(default_factory=dict)
    links: dict[str, Link] = field(default_factory=dict)
    """By the id of the internal edge."""
    route_edges: dict[str, tuple[str, ...]] = field(default_factory=dict)
    arcs: dict[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    """By route and SUMO lane: arc length at the lane's begin [m], and metres of route per metre of lane."""
    yields: set[tuple[str, str]] = field(default_factory=set)
    """Pairs of routes that conflict: the first waits for the second."""
    has_signs: bool = True
    """Whether anybody waits by rule."""


def read(path: Path = BENDPLATZ.source) -> tuple[MapSource, Network]:
    """A map's source and its network; the compiled map may lie beside the source."""
    source, compiled = MapSource.read(path), path.with_suffix(".map")
    return source, build(source, compiled.read_text(encoding="utf-8") if compiled.exists() else compile_file(path))


def build(source: MapSource, compiled: str) -> Network:
    """The network of every route of the map; `compiled` is the text of the compiled map."""
    paths, yields = _paths(source, compiled)
    network = Network(paths, yields=yields)
    for name in dict.fromkeys(name for route in source.routes for name in route.approach + route.leaving):
        network.edges[name] = _edge(source, paths, name)
    for route in source.routes:
        _add_route(network, source, route)
    return network


def without_signs(network: Network) -> Network:
    """The same ways, on which nobody waits by rule: only for those who are on the junction already."""
    links = {edge_id: replace(link, state=LINK_STATE["priority"]) for edge_id, link in network.links.items()}
    return replace(network, links=links, has_signs=False)


def length(points: Points) -> float:
    """The length of a polyline [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _paths(source: MapSource, compiled: str) -> tuple[dict[str, Path2D], set[tuple[str, str]]]:
    """The routes' centrelines with the compiled map's stop lines, and its conflicts."""
    stop, end, conflicts, rest = {}, {}, [], 0
    for line in compiled.splitlines():
        word, *values = line.split()
        if rest:
            conflicts.append((int(word), int(values[0])))
            rest -= 1
        elif word == "route":
            route = values[0]
        elif word == "stop_line":
            stop[route] = float(values[0])
        elif word == "junction":
            end[route] = float(values[1])
        elif word == "conflicts":
            rest = int(values[0])
    paths = {}
    for one in source.routes:
        pieces = source.pieces(one)
        points = np.concatenate([pieces[0].points, *(piece.points[1:] for piece in pieces[1:])])
        points = points[np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]]
        paths[one.id] = Path2D(one.id, points, along(points), stop[one.id], end[one.id])
    ids = [one.id for one in source.routes]
    return paths, {(ids[first], ids[second]) for first, second in conflicts}


def _edge(source: MapSource, paths: dict[str, Path2D], name: str) -> Edge:
    """The lane; if routes wait at its end, up to the stop line on the one with the middle distance."""
    lane = source.lanes[name]
    waiting = [route for route in source.routes if route.approach[-1] == name]
    arm = next(r.entry if name in r.approach else r.exit for r in source.routes if name in r.approach + r.leaving)
    shape = lane.points
    if waiting:
        by_distance = sorted(waiting, key=lambda route: (paths[route.id].stop_line, route.id))
        path = paths[by_distance[len(waiting) // 2].id]
        begin = float(path.arc[np.argmin(np.linalg.norm(path.points - lane.points[0], axis=1))])
        shape = path.between(begin, path.stop_line - STANDOFF)
    return Edge(shape, source.arms[arm].speed_limit)


def _add_route(network: Network, source: MapSource, route: RouteSource) -> None:
    path = network.paths[route.id]
    names = route.approach + route.leaving
    network.route_edges[route.id] = names
    network.edges[names[0]].begin_node = route.entry
    network.edges[names[-1]].end_node = f"{route.exit}_end"
    pieces = source.pieces(route)
    ends = np.cumsum([length(piece.points) for piece in pieces])
    ends[next(i for i, piece in enumerate(pieces) if piece.inside_junction) - 1] = path.stop_line - STANDOFF
    before = ""
    for number, piece in enumerate(pieces):
        arcs = float(ends[number - 1]) if number else 0.0, float(ends[number])
        if piece.lane is not None:
            before = piece.lane
            _map_lane(network, route.id, before, network.edges[before].shape, arcs)
        else:
            after = names[names.index(before) + 1]
            edge_id = _add_link(network, source, route, piece, before, after, arcs)
            _map_lane(network, route.id, edge_id, network.links[edge_id].shape, arcs)


def _add_link(
    network: Network,
    source: MapSource,
    route: RouteSource,
    piece: Piece,
    before: str,
    after: str,
    arcs: tuple[float, float],
) -> str:
    for edge_id, link in network.links.items():
        if (link.before, link.after) == (before, after):
            return edge_id
    path = network.paths[route.id]
    shape = path.between(arcs[0], path.junction_end) if piece.inside_junction else piece.points
    node = CENTRE if piece.inside_junction else f"{before}_end"
    limit = min(network.edges[before].speed, network.edges[after].speed)
    lateral = TURN_ACCELERATION if piece.inside_junction else SHIFT_ACCELERATION
    speed = min(limit, curve_speed(path, arcs, lateral))
    edge_id = f":{node}_{sum(link.node == node for link in network.links.values())}"
    network.edges[before].end_node = network.edges[after].begin_node = node
    link = Link(before, after, node, shape, speed)
    if piece.inside_junction:
        right_of_way, turn = source.arms[route.entry].right_of_way, source.turn(route)
        state = "m" if right_of_way == "priority" and turn == "left" else LINK_STATE[right_of_way]
        speeds = {one: min(limit, curve_speed(path, arcs, lateral)) for one, lateral in CORNERING.items()}
        link = Link(before, after, node, shape, speed, DIRECTION[turn], state, VISIBILITY[right_of_way], speeds)
    network.links[edge_id] = link
    return edge_id


def _map_lane(network: Network, route: str, edge: str, shape: Points, arcs: tuple[float, float]) -> None:
    network.arcs[route, f"{edge}_0"] = arcs[0], (arcs[1] - arcs[0]) / round(length(shape), 2)


def curve_speed(path: Path2D, arcs: tuple[float, float], lateral: float) -> float:
    """The speed at which the sharpest bend between two arc lengths needs `lateral` m/s^2 sideways [m/s]."""
    arc = np.arange(arcs[0], arcs[1] + 0.25, 0.25)
    change = path.heading(arc + CURVATURE_WINDOW / 2.0) - path.heading(arc - CURVATURE_WINDOW / 2.0)
    turn = np.abs((change + np.pi) % (2.0 * np.pi) - np.pi)
    return float(np.sqrt(lateral * CURVATURE_WINDOW / max(float(turn.max()), 1e-3)))
