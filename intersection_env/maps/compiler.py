"""Compiles a map source with shapely into the flat, self-contained text that the core reads."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from itertools import chain, combinations
from pathlib import Path

from intersection_env.maps.conflicts import Encounter, Meeting, encounters_of, meeting
from intersection_env.maps.meeting import Conflict, Overlap, SharedLane
from intersection_env.maps.route import HEADING_OFFSETS, SPACING, CompiledRoute, compile_route
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import RouteSource

MAGIC = "intersection_env map"
VERSION = 2


def compile_map(source: MapSource) -> str:
    """The text of the compiled map, checksum included.

    Raises:
        ValueError: the geometry contradicts itself (a stop line that a route does not cross, routes that share lanes
            in too many places, ...), or the source leaves pairs of routes undecided: all of them are named, with
            what could be said.
    """
    return Recompiler().compile(source)


class Recompiler:
    """Compiles sources one after another; what one has in common with the one before is not computed again.

    In common are lanes, routes and rules that are the same objects, as in a source made by `dataclasses.replace`.
    """

    def __init__(self) -> None:
        self._rules: tuple[object, ...] = ()
        self._routes: dict[str, tuple[tuple[object, ...], CompiledRoute]] = {}
        self._meetings: dict[tuple[int, int], tuple[tuple[CompiledRoute, CompiledRoute], Meeting]] = {}

    def compile(self, source: MapSource) -> str:
        """The text of the compiled map.

        Raises:
            ValueError: as `compile_map`.
        """
        rules = (source.arms, source.stop_lines, source.yields, source.free)
        if not _same(rules, self._rules):
            self._rules, self._routes, self._meetings = rules, {}, {}
        routes = [self._route(source, route) for route in source.routes]
        pairs = combinations(range(len(routes)), 2)
        meetings = [self._meeting(source, (a, b), (routes[a], routes[b])) for a, b in pairs]
        _check_decided(meetings)
        conflicts = [one for found in meetings for one in found.conflicts]
        shared = [one for found in meetings for one in found.shared]
        overlaps = [one for found in meetings for one in found.overlaps]
        return _text(source, routes, conflicts, shared, overlaps)

    def _route(self, source: MapSource, route: RouteSource) -> CompiledRoute:
        lanes = (*route.approach, *route.interior, *route.leaving)
        made_of = (route, *(source.lanes[name] for name in lanes))
        known = self._routes.get(route.id)
        if known is None or not _same(known[0], made_of):
            known = self._routes[route.id] = made_of, compile_route(source, route)
        return known[1]

    def _meeting(
        self, source: MapSource, index: tuple[int, int], routes: tuple[CompiledRoute, CompiledRoute]
    ) -> Meeting:
        known = self._meetings.get(index)
        if known is None or not _same(known[0], routes):
            known = self._meetings[index] = routes, meeting(source, index, routes)
        return known[1]


def _same(one: Sequence[object], other: Sequence[object]) -> bool:
    """Whether these are the same objects."""
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


def encounters(source: MapSource) -> list[Encounter]:
    """Where two routes conflict, pair by pair, for who writes a source.

    Raises:
        ValueError: as `compile_map`, but for what is undecided.
    """
    routes = [compile_route(source, route) for route in source.routes]
    return list(chain.from_iterable(encounters_of(source, a, b) for a, b in combinations(routes, 2)))


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


def _check_decided(meetings: list[Meeting]) -> None:
    """Refuses a source that leaves pairs of routes undecided, with all of them and a proposal."""
    problems = list(chain.from_iterable(found.open for found in meetings))
    if not problems:
        return
    problems.insert(0, f"{len(problems)} undecided:")
    proposals = list(chain.from_iterable(found.yields for found in meetings))
    if proposals:
        said = ", ".join(json.dumps(list(pair)) for pair in proposals)
        problems.append(f'say who waits: "yields": [{said}] would let the second of each pair go first')
    problems.append('or declare pairs that do not conflict: "free": [["ONE", "OTHER"], ...]')
    raise ValueError("\n  ".join(problems))


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
        lines.append(_row("must_stop", int(route.must_stop)))
        lines.append(_row("stop_lane", stop_lanes.index(route.source.approach[-1])))
        lines.append(_row("junction", *route.junction))
        lines.append(_row("first_conflict", min(begins, default=route.line.length)))
        lines.append(_row("samples", len(route.samples)))
        lines.extend(_row(*values) for values in route.samples)
    lines.append(_row("conflicts", len(conflicts)))
    for one in conflicts:
        kinds = int(one.merging), int(one.by_arrival)
        lines.append(_row(one.yielder, one.prioritized, *kinds, *one.on_yielder, *one.on_prioritized, one.line))
    lines.append(_row("shared_lanes", len(shared)))
    lines.extend(_row(*lane) for lane in shared)
    lines.append(_row("overlaps", len(overlaps)))
    lines.extend(_row(*overlap) for overlap in overlaps)
    body = "\n".join(lines) + "\n"
    return f"{body}checksum {zlib.crc32(body.encode()):08x}\n"


def _row(*values: object) -> str:
    return " ".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in values)
