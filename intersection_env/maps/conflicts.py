"""Where two routes conflict: outside of the lanes that they share, where what their vehicles sweep overlaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely.ops import substring

from intersection_env.maps.meeting import NEVER, SWEPT_WIDTH, Conflict, Interval, Overlap, SharedLane
from intersection_env.maps.right_of_way import Ruling, is_by_arrival, ruling, who_waits
from intersection_env.maps.route import CompiledRoute, swept
from intersection_env.maps.shared import shared_lanes
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import RouteSource

LEAST_AREA = 0.05  # [m²], ours: bands that touch by less do not meet
EARLIEST = 0.5  # [m], ours: a conflict may begin so far before a stop line


class Area(NamedTuple):
    """Where two routes meet, as arc lengths on each [m]; merging: a lane that they share follows."""

    on_a: Interval
    on_b: Interval
    merging: bool


class Encounter(NamedTuple):
    """Two routes that conflict.

    early: of each, how far before its stop line the conflict begins [m], negative behind it. first_yields: whether
    the first waits; None where the source leaves it open.
    """

    first: RouteSource
    second: RouteSource
    early: tuple[float, float]
    first_yields: bool | None


@dataclass(frozen=True)
class Meeting:
    """How two routes meet. open: what the source leaves undecided, in words; yields: what could be said of it."""

    shared: list[SharedLane]
    conflicts: list[Conflict]
    overlaps: list[Overlap]
    open: list[str]
    yields: list[tuple[str, str]]


def meeting(source: MapSource, index: tuple[int, int], routes: tuple[CompiledRoute, CompiledRoute]) -> Meeting:
    """How two routes meet, given by their indices.

    Raises:
        ValueError: as `shared_lanes`.
    """
    a, b = routes
    shared = shared_lanes(index[0], a, index[1], b)
    found = Meeting(shared, [], [], [], [])
    areas: list[Area] = []
    if frozenset((a.source.id, b.source.id)) not in source.free:
        areas = list(_areas(a, b, shared))
    ruled = [(area, ruling(source, a, b, area.on_a, area.on_b)) for area in areas]
    for first_yields in (True, False):
        own = [(area, said) for area, said in ruled if said.first_yields is first_yields]
        if own:
            area = _hull([one for one, _ in own])
            found.open.extend(_early(a, b, area))
            found.conflicts.append(_conflict(source, index, routes, area, own[0][1]))
    if any(said.first_yields is None for _, said in ruled):
        found.yields.append(who_waits(source, a, b))
        found.open.append(
            f'routes "{a.source.id}" and "{b.source.id}" conflict with equal right of way and neither comes from the'
            " right"
        )
    found.overlaps.extend(_overlaps(index, routes, shared, found.conflicts))
    return found


def encounters_of(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> Iterator[Encounter]:
    """Where two routes conflict, for who writes a source.

    Raises:
        ValueError: as `shared_lanes`.
    """
    if frozenset((a.source.id, b.source.id)) in source.free:
        return
    for area in _areas(a, b, shared_lanes(0, a, 1, b)):
        early = a.stop_line - area.on_a[0], b.stop_line - area.on_b[0]
        yield Encounter(a.source, b.source, early, ruling(source, a, b, area.on_a, area.on_b).first_yields)


def _areas(a: CompiledRoute, b: CompiledRoute, shared: list[SharedLane]) -> Iterator[Area]:
    """Where bands around two routes overlap beside what they share; of those from one lane, before they merge."""
    parted = any(max(one.begin_a, one.begin_b) == -NEVER for one in shared)
    sections_a = list(_sections(a.line.length, [(one.begin_a, one.end) for one in shared]))
    sections_b = list(_sections(b.line.length, [(one.begin_b, one.end + one.offset) for one in shared]))
    bands_a, bands_b = [_swept(a, one) for one in sections_a], [_swept(b, one) for one in sections_b]
    for section_a, one in zip(sections_a, bands_a, strict=True):
        for section_b, other in zip(sections_b, bands_b, strict=True):
            if one is None or other is None or not shapely.intersects(one, other):
                continue
            merging = any((section_a[1], section_b[1]) == (lane.begin_a, lane.begin_b) for lane in shared)
            if merging:
                yield from _parts(a, b, one.intersection(other), (section_a[1], section_b[1]))
            elif not parted:
                yield from _parts(a, b, one.intersection(other), None)


def _sections(length: float, shared: list[Interval]) -> Iterator[Interval]:
    """What is left of a route without the lanes that it shares."""
    begin = 0.0
    for first, last in sorted(shared):
        yield begin, first
        begin = last
    yield begin, length


def _swept(route: CompiledRoute, section: Interval) -> shapely.Polygon | None:
    begin, end = section
    if end - max(begin, 0.0) < SWEPT_WIDTH / 2.0:
        return None
    return route.band if section == (0.0, route.line.length) else swept(substring(route.line, begin, end))


def _parts(
    a: CompiledRoute, b: CompiledRoute, area: shapely.Geometry, merge: tuple[float, float] | None
) -> Iterator[Area]:
    """The parts of an area; the last one before a merge ends there, on each route."""
    parts = [part for part in shapely.get_parts(area) if isinstance(part, shapely.Polygon)]
    if sum(part.area for part in parts) < LEAST_AREA:
        return
    found = []
    for part in parts:
        corners = shapely.points(shapely.get_coordinates(part))
        along_a, along_b = (shapely.line_locate_point(route.line, corners) for route in (a, b))
        on_a, on_b = ((float(along.min()), float(along.max())) for along in (along_a, along_b))
        found.append(Area(on_a, on_b, False))
    if merge is not None:
        last = max(range(len(found)), key=lambda number: found[number].on_a[1])
        begin_a, begin_b = found[last].on_a[0], found[last].on_b[0]
        found[last] = Area((begin_a, merge[0]), (begin_b, merge[1]), True)
    yield from found


def _hull(areas: list[Area]) -> Area:
    """One area for several in which the same one waits."""
    ends_a, ends_b = (np.array([getattr(area, on) for area in areas]) for on in ("on_a", "on_b"))
    merging = max(areas, key=lambda area: area.on_a[1]).merging
    on_a, on_b = ((float(ends[:, 0].min()), float(ends[:, 1].max())) for ends in (ends_a, ends_b))
    return Area(on_a, on_b, merging)


def _early(a: CompiledRoute, b: CompiledRoute, area: Area) -> Iterator[str]:
    for route, interval in ((a, area.on_a), (b, area.on_b)):
        early = route.stop_line - interval[0]
        if early > EARLIEST:
            yield (
                f'the conflict of routes "{a.source.id}" and "{b.source.id}" begins {early:.1f} m'
                f' before the stop line of "{route.source.id}"; draw that line, or the lanes, further apart'
            )


def _conflict(
    source: MapSource,
    index: tuple[int, int],
    routes: tuple[CompiledRoute, CompiledRoute],
    area: Area,
    said: Ruling,
) -> Conflict:
    (yielder, on_yielder), (prioritized, on_prioritized) = (0, area.on_a), (1, area.on_b)
    if not said.first_yields:
        (yielder, on_yielder), (prioritized, on_prioritized) = (1, area.on_b), (0, area.on_a)
    line = routes[prioritized].stop_line
    if said.circulates:  # it has left that behind: as far before the conflict as the yielder's line is
        line = on_prioritized[0] - (on_yielder[0] - routes[yielder].stop_line)
    by_arrival = is_by_arrival(source, *routes)
    return Conflict(index[yielder], index[prioritized], area.merging, by_arrival, on_yielder, on_prioritized, line)


def _overlaps(
    index: tuple[int, int],
    routes: tuple[CompiledRoute, CompiledRoute],
    shared: list[SharedLane],
    conflicts: list[Conflict],
) -> Iterator[Overlap]:
    """Where vehicles can touch: in each conflict, and in each lane that they share, from the merge into it on."""
    on_both = [
        ((one.on_yielder, one.on_prioritized) if one.yielder == index[0] else (one.on_prioritized, one.on_yielder))
        for one in conflicts
    ]
    merges = {
        (on_a[1], on_b[1]): (on_a[0], on_b[0])
        for (on_a, on_b), one in zip(on_both, conflicts, strict=True)
        if one.merging
    }
    for lane in shared:
        begin_a, begin_b = merges.get((lane.begin_a, lane.begin_b), (lane.begin_a, lane.begin_b))
        end_a, end_b = lane.end, lane.end + lane.offset
        if lane.end == NEVER:
            end_a, end_b = (route.line.length for route in routes)
        yield Overlap(*index, max(begin_a, 0.0), end_a, max(begin_b, 0.0), end_b)
    for (on_a, on_b), one in zip(on_both, conflicts, strict=True):
        if not one.merging:
            yield Overlap(*index, *on_a, *on_b)
