"""Compiles a map source with shapely into the flat, self-contained text that the core reads."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from intersection_env.maps.curve import Points, along, wrap
from intersection_env.maps.meeting import NEVER, SWEPT_WIDTH, Conflict, SharedLane
from intersection_env.maps.source import MapSource, RouteSource

MAGIC = "intersection_env map"
VERSION = 1
SPACING = 1.0  # [m], ours: linear interpolation on this grid is within 2 cm of an arc of 6 m radius
HEADING_OFFSETS = (-10.0, -3.0, 3.0, 10.0, 30.0, 100.0)  # [m], paper, Table I
MERGED_DISTANCE = 1.0  # [m], ours: nearer than this to a lane's centreline, a vehicle is in that lane
LEFT_TURN_RANK, MINOR_RANK = 1, 2


@dataclass(frozen=True)
class CompiledRoute:
    """One route as the core will know it; arc lengths [m] from the route's start."""

    source: RouteSource
    line: shapely.LineString
    samples: NDArray[np.float64]
    """(sample, 11): x, y, heading (unwrapped), lane width, v_max, relative heading at six offsets."""
    stop_line: float
    junction: tuple[float, float]
    rank: int


class Overlap(NamedTuple):
    """Where vehicles of two routes can touch: from an arc length to another on each [m]."""

    a: int
    b: int
    begin_a: float
    end_a: float
    begin_b: float
    end_b: float


class Encounter(NamedTuple):
    """Two routes from different lanes that meet.

    early: of each, how far before its stop line the conflict begins [m], negative behind it. first_yields: whether
    the first waits; None where the source leaves it open.
    """

    first: RouteSource
    second: RouteSource
    early: tuple[float, float]
    first_yields: bool | None


def compile_map(source: MapSource) -> str:
    """The text of the compiled map, checksum included.

    Raises:
        ValueError: two routes share a later lane but not the first, or the geometry contradicts itself (a
            stop line that a route does not cross, two routes of equal rank that conflict and neither comes
            from the right, ...); the message names the routes.
    """
    for one, other in combinations(source.routes, 2):
        _check_later_lanes(one, other)
    routes = [_compile_route(source, route) for route in source.routes]
    conflicts: list[Conflict] = []
    shared: list[SharedLane] = []
    overlaps: list[Overlap] = []
    for a, b in combinations(range(len(routes)), 2):
        lane = _shared_lane(a, routes[a], b, routes[b])
        if lane is not None:
            shared.append(lane)
        if lane is not None and lane.split > 0.0:
            overlaps.append(Overlap(a, b, 0.0, lane.split, 0.0, lane.split))
            continue
        conflict = _conflict(source, a, routes[a], b, routes[b], lane)
        if conflict is not None:
            conflicts.append(conflict)
            overlaps.append(_overlap(conflict, routes))
    return _text(source, routes, conflicts, shared, overlaps)


def encounters(source: MapSource) -> list[Encounter]:
    """The pairs of routes from different lanes that meet, for who writes a source.

    Raises:
        ValueError: as `compile_map`, but for conflicts that begin too early and pairs of which nobody yields.
    """
    routes = [_compile_route(source, route) for route in source.routes]
    found: list[Encounter] = []
    for a, b in combinations(range(len(routes)), 2):
        lane = _shared_lane(a, routes[a], b, routes[b])
        if lane is not None and lane.split > 0.0:
            continue
        one, other = routes[a], routes[b]
        intervals = _meeting(one, other, lane)
        if intervals is not None:
            early = one.stop_line - intervals[0][0], other.stop_line - intervals[1][0]
            found.append(Encounter(one.source, other.source, early, _yields(source, one, other)))
    return found


def compile_file(path: str | Path) -> str:
    """The text of the compiled map of a source file.

    Raises:
        ValueError: as `MapSource.read` and `compile_map`; the message names the file.
        OSError: the file cannot be read.
    """
    source = MapSource.read(path)
    try:
        return compile_map(source)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _compile_route(source: MapSource, route: RouteSource) -> CompiledRoute:
    pieces = source.pieces(route)
    polyline = np.concatenate([pieces[0].points, *(piece.points[1:] for piece in pieces[1:])])
    line = shapely.LineString(_refine(polyline))
    ends = np.cumsum([shapely.LineString(piece.points).length for piece in pieces])
    inside = next(number for number, piece in enumerate(pieces) if piece.inside_junction)
    junction = (float(ends[inside - 1]), float(ends[inside]))
    stop_line = _stop_line(source, route, line, junction[0])
    widths = np.concatenate([pieces[0].width, *(piece.width[1:] for piece in pieces[1:])])
    samples = _samples(source, route, line, (along(polyline), widths), junction[1])
    rank = 0 if source.arms[route.entry].right_of_way == "priority" else MINOR_RANK
    rank += LEFT_TURN_RANK if source.turn(route) == "left" else 0
    return CompiledRoute(route, line, samples, stop_line, junction, rank)


def _refine(polyline: Points) -> Points:
    line = shapely.segmentize(shapely.LineString(polyline), 0.25)
    points = shapely.get_coordinates(line)
    return np.asarray(points[np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]])


def _stop_line(source: MapSource, route: RouteSource, line: shapely.LineString, approach_end: float) -> float:
    painted = source.stop_lines.get(route.approach[-1])
    if painted is None:
        return approach_end
    crossing = line.intersection(shapely.LineString(painted))
    if not isinstance(crossing, shapely.Point) or crossing.is_empty:
        raise ValueError(f'route "{route.id}" must cross the stop line of "{route.approach[-1]}" once')
    return float(line.project(crossing))


def _samples(
    source: MapSource,
    route: RouteSource,
    line: shapely.LineString,
    widths: tuple[NDArray[np.float64], NDArray[np.float64]],
    junction_end: float,
) -> NDArray[np.float64]:
    """As `CompiledRoute.samples`; widths: the lane's [m], and at which arc lengths [m]."""
    s = SPACING * np.arange(int(np.ceil(line.length / SPACING)) + 1)
    steps = np.diff(shapely.get_coordinates(line), axis=0)
    length = np.linalg.norm(steps, axis=1)
    middle = np.cumsum(length) - 0.5 * length
    east, north = steps.T
    headings = np.unwrap(np.arctan2(north, east))
    heading = np.interp(s, middle, headings)
    relative = np.stack([np.interp(s + n, middle, headings) - heading for n in HEADING_OFFSETS], axis=1)
    position = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(s, line.length)))
    beyond = np.maximum(s - line.length, 0.0)[:, None]
    position = position + beyond * np.stack([np.cos(headings[-1:]), np.sin(headings[-1:])], axis=1)
    width = np.interp(s, *widths)
    limits = source.arms[route.entry].speed_limit, source.arms[route.exit].speed_limit
    v_max = np.where(s < junction_end, *limits)
    return np.column_stack([position, heading, width, v_max, relative])


def _shared_lane(index_a: int, a: CompiledRoute, index_b: int, b: CompiledRoute) -> SharedLane | None:
    split, merge_a, merge_b, offset = -NEVER, NEVER, NEVER, 0.0
    if a.source.approach[0] == b.source.approach[0]:
        apart = _first_where(a.line, b.line, lambda distance: distance > SWEPT_WIDTH)
        split = a.line.length if apart is None else apart
    if a.source.leaving[0] == b.source.leaving[0]:
        near_a = _first_where(a.line, b.line, lambda distance: distance < MERGED_DISTANCE)
        near_b = _first_where(b.line, a.line, lambda distance: distance < MERGED_DISTANCE)
        assert near_a is not None
        assert near_b is not None
        merge_a, merge_b, offset = near_a, near_b, b.junction[1] - a.junction[1]
    if split < 0.0 and merge_a == NEVER:
        return None
    return SharedLane(index_a, index_b, split, merge_a, merge_b, offset)


def _check_later_lanes(a: RouteSource, b: RouteSource) -> None:
    """Refuses routes that meet or part in ways a shared lane, from the start or to the end, cannot say."""
    for part, lanes_a, lanes_b in (("exit", a.leaving, b.leaving), ("approach", a.approach, b.approach)):
        common = [lane for lane in lanes_a if lane in lanes_b]
        if common and lanes_a[0] != lanes_b[0]:
            raise ValueError(
                f'routes "{a.id}" and "{b.id}" share the {part} lane "{common[0]}" but not the first;'
                f" let them share the first {part} lane"
            )
    if a.leaving[0] == b.leaving[0] and a.leaving != b.leaving:
        raise ValueError(
            f'routes "{a.id}" and "{b.id}" share the exit lane "{a.leaving[0]}" and part later;'
            " let them share all exit lanes"
        )
    for route in (a, b):
        if len(set(route.approach + route.leaving)) < len(route.approach + route.leaving):
            raise ValueError(f'route "{route.id}" uses a lane twice')


def _first_where(
    line: shapely.LineString,
    other: shapely.LineString,
    holds: Callable[[NDArray[np.float64]], NDArray[np.bool_]],
) -> float | None:
    """The first arc length on `line` at which the distance to `other` is as wanted, on a grid of 0.1 m."""
    s = np.arange(0.0, line.length, 0.1)
    distance = shapely.distance(shapely.line_interpolate_point(line, s), other)
    found = np.flatnonzero(holds(distance))
    return float(s[found[0]]) if len(found) else None


def _meeting(
    a: CompiledRoute, b: CompiledRoute, lane: SharedLane | None
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Where two routes from different lanes meet, as arc lengths on each [m]; None where they do not."""
    swept_a, swept_b = (shapely.buffer(route.line, SWEPT_WIDTH / 2.0, cap_style="flat") for route in (a, b))
    area = swept_a.intersection(swept_b)
    if area.is_empty or area.area < 0.05:
        return None
    corners = shapely.points(shapely.get_coordinates(area))
    along_a, along_b = (shapely.line_locate_point(route.line, corners) for route in (a, b))
    interval_a = (float(along_a.min()), lane.merge_a if lane is not None else float(along_a.max()))
    interval_b = (float(along_b.min()), lane.merge_b if lane is not None else float(along_b.max()))
    return interval_a, interval_b


def _conflict(
    source: MapSource, index_a: int, a: CompiledRoute, index_b: int, b: CompiledRoute, lane: SharedLane | None
) -> Conflict | None:
    intervals = _meeting(a, b, lane)
    if intervals is None:
        return None
    merging, (interval_a, interval_b) = lane is not None, intervals
    for route, interval in ((a, interval_a), (b, interval_b)):
        if interval[0] < route.stop_line - 0.5:
            early = route.stop_line - interval[0]
            raise ValueError(
                f'the conflict of routes "{a.source.id}" and "{b.source.id}" begins {early:.1f} m'
                f' before the stop line of "{route.source.id}"; draw that line, or the lanes, further apart'
            )
    first_yields = _yields(source, a, b)
    if first_yields is None:
        raise ValueError(
            f'routes "{a.source.id}" and "{b.source.id}" conflict with equal right of way and neither comes from the'
            ' right; say who waits under "yields"'
        )
    if first_yields:
        return Conflict(index_a, index_b, merging, interval_a, interval_b)
    return Conflict(index_b, index_a, merging, interval_b, interval_a)


def _yields(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> bool | None:
    """Whether route a yields to route b: by the source's own word, by rank, else right before left; None: unsaid."""
    if (a.source.id, b.source.id) in source.yields:
        return True
    if (b.source.id, a.source.id) in source.yields:
        return False
    if a.rank != b.rank:
        return a.rank > b.rank
    bearing = wrap(source.approach_heading(b.source) - source.approach_heading(a.source))
    if np.radians(20.0) < abs(bearing) < np.radians(160.0):
        return bearing > 0.0
    return None


def _overlap(conflict: Conflict, routes: list[CompiledRoute]) -> Overlap:
    """Where the two routes' vehicles can touch: the conflict, and after a merge the lane they share."""
    (begin_a, end_a), (begin_b, end_b) = conflict.on_yielder, conflict.on_prioritized
    if conflict.merging:
        end_a, end_b = routes[conflict.yielder].line.length, routes[conflict.prioritized].line.length
    return Overlap(conflict.yielder, conflict.prioritized, begin_a, end_a, begin_b, end_b)


def _text(
    source: MapSource,
    routes: list[CompiledRoute],
    conflicts: list[Conflict],
    shared: list[SharedLane],
    overlaps: list[Overlap],
) -> str:
    stop_lanes = list(dict.fromkeys(route.source.approach[-1] for route in routes))
    lines = [f"{MAGIC} {VERSION}", f"name {source.name}"]
    lines.append(_row("locations", len(source.locations), *source.locations))
    lines.append(_row("spacing", SPACING))
    lines.append(_row("heading_offsets", len(HEADING_OFFSETS), *HEADING_OFFSETS))
    lines.append(_row("routes", len(routes)))
    for number, route in enumerate(routes):
        begins = [one.on_yielder[0] for one in conflicts if one.yielder == number]
        begins += [one.on_prioritized[0] for one in conflicts if one.prioritized == number]
        lines.append(f"route {route.source.id}")
        lines.append(_row("length", route.line.length))
        lines.append(_row("stop_line", route.stop_line))
        lines.append(_row("stop_lane", stop_lanes.index(route.source.approach[-1])))
        lines.append(_row("junction", *route.junction))
        lines.append(_row("first_conflict", min(begins, default=route.line.length)))
        lines.append(_row("samples", len(route.samples)))
        lines.extend(_row(*values) for values in route.samples)
    lines.append(_row("conflicts", len(conflicts)))
    for one in conflicts:
        lines.append(_row(one.yielder, one.prioritized, int(one.merging), *one.on_yielder, *one.on_prioritized))
    lines.append(_row("shared_lanes", len(shared)))
    lines.extend(_row(*lane) for lane in shared)
    lines.append(_row("overlaps", len(overlaps)))
    lines.extend(_row(*overlap) for overlap in overlaps)
    body = "\n".join(lines) + "\n"
    return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"


def _row(*values: object) -> str:
    return " ".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in values)
