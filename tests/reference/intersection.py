"""The map: a compiled map as its file says it (docs/formats.md), and what holds between the samples of a route."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


class Sample(IntEnum):
    """Columns of a route's samples; the last six are relative headings, at -10, -3, 3, 10, 30 and 100 m."""

    X = 0
    Y = 1
    HEADING = 2
    WIDTH = 3
    V_MAX = 4
    HEADING_10_BEHIND = 5
    HEADING_3_BEHIND = 6
    HEADING_3_AHEAD = 7
    HEADING_10_AHEAD = 8
    HEADING_30_AHEAD = 9
    HEADING_100_AHEAD = 10


HEADINGS = slice(Sample.HEADING_10_BEHIND, Sample.HEADING_100_AHEAD + 1)


@dataclass(frozen=True)
class Route:
    """A centreline by arc length [m]; samples: (sample, Sample)."""

    id: str
    length: float
    stop_line: float
    must_stop: bool
    stop_lane: int
    junction_begin: float
    junction_end: float
    first_conflict: float
    samples: Floats


@dataclass(frozen=True)
class Conflict:
    """Intervals [m] on the yielder's and on the prioritized route; their ends are the PGAs.

    line: on the prioritized route [m]. by_arrival: who arrived first at an all-way stop goes first.
    """

    yielder: int
    prioritized: int
    merging: bool
    by_arrival: bool
    begin_yielder: float
    end_yielder: float
    begin_prioritized: float
    end_prioritized: float
    line: float


@dataclass(frozen=True)
class SharedLane:
    """Routes a < b share a lane from their begins in it on, position_b = position_a + offset [m].

    It ends at `end` on a.
    """

    a: int
    b: int
    begin_a: float
    begin_b: float
    end: float
    offset: float


@dataclass(frozen=True)
class Overlap:
    """Where vehicles of two routes can touch [m]."""

    a: int
    b: int
    begin_a: float
    end_a: float
    begin_b: float
    end_b: float


@dataclass(frozen=True)
class Map:
    """A compiled map."""

    name: str
    spacing: float
    routes: tuple[Route, ...]
    conflicts: tuple[Conflict, ...]
    shared_lanes: tuple[SharedLane, ...]
    overlaps: tuple[Overlap, ...]

    @cached_property
    def ranks(self) -> list[int]:
        """(Route,). Whoever waits itself holds up those who yield to it, but for those below it."""
        routes, yields = range(len(self.routes)), {(one.yielder, one.prioritized) for one in self.conflicts}
        yielders, arms = {yielder for yielder, _ in yields}, [route.id.split("-")[0] for route in self.routes]
        major_arms = {arms[prioritized] for _, prioritized in yields if prioritized not in yielders}

        def reached(start: int, some: list[int]) -> set[int]:
            """To whom it yields of these, to whom those do, and so on."""
            found: set[int] = set()
            while new := {j for i, j in yields if i in {start, *found} and j in some} - found:
                found |= new
            return found

        def yielders_first(some: list[int]) -> list[int]:
            through, left, result = {route: reached(route, some) for route in some}, list(some), []
            while left:
                to = {route: [other for other in left if (other, route) in yields] for route in left}
                due = [route for route in left if through[route] >= set(to[route])]
                result.append(min(due, key=lambda route: len(to[route])))
                left.remove(result[-1])
            return result

        major = yielders_first([route for route in routes if arms[route] in major_arms])
        minor = yielders_first([route for route in routes if arms[route] not in major_arms])
        ranked = [*reversed(major), *minor]
        return [ranked.index(route) for route in routes]


def sample(intersection: Map, route: int, position: float) -> Floats:
    """(Sample,): the values at an arc length, interpolated linearly; beyond the ends the end value holds."""
    samples = intersection.routes[route].samples
    at = min(max(position / intersection.spacing, 0.0), len(samples) - 1.0)
    before = min(int(at), len(samples) - 2)
    fraction = at - before
    return np.asarray(samples[before] * (1 - fraction) + samples[before + 1] * fraction)


def load_map(path: str | Path) -> Map:
    """Reads a compiled map. Raises: ValueError on another magic, version, checksum or trailing lines."""
    data = Path(path).read_bytes()
    body, last = data[: data.rindex(b"checksum ")], data[data.rindex(b"checksum ") :].decode().split()
    if last != ["checksum", f"{zlib.crc32(body):08x}"]:
        raise ValueError(f"{path}: checksum {last[1:]}, but the bytes give {zlib.crc32(body):08x}")
    lines = iter([line.split() for line in body.decode().splitlines()])
    if next(lines) != ["intersection_env", "map", "2"]:
        raise ValueError(f"{path}: not an intersection_env map of version 2")
    (name,) = _field(lines, "name")
    _field(lines, "locations")
    (spacing,) = _field(lines, "spacing")
    _field(lines, "heading_offsets")
    result = Map(
        name,
        float(spacing),
        tuple(_route(lines) for _ in range(_count(lines, "routes"))),
        tuple(
            Conflict(int(row[0]), int(row[1]), row[2] == "1", row[3] == "1", *map(float, row[4:]))
            for row in _rows(lines, "conflicts")
        ),
        tuple(SharedLane(int(row[0]), int(row[1]), *map(float, row[2:])) for row in _rows(lines, "shared_lanes")),
        tuple(Overlap(int(row[0]), int(row[1]), *map(float, row[2:])) for row in _rows(lines, "overlaps")),
    )
    if (rest := list(lines)) != []:
        raise ValueError(f"{path}: {len(rest)} unexpected lines before the checksum")
    return result


def _field(lines: Iterator[list[str]], key: str) -> list[str]:
    """The tokens after `key` on the next line."""
    tokens = next(lines)
    if tokens[0] != key:
        raise ValueError(f"map: got {tokens[0]!r}, wanted {key!r}")
    return tokens[1:]


def _count(lines: Iterator[list[str]], key: str) -> int:
    return int(_field(lines, key)[0])


def _rows(lines: Iterator[list[str]], key: str) -> list[list[str]]:
    return [next(lines) for _ in range(_count(lines, key))]


def _route(lines: Iterator[list[str]]) -> Route:
    (identity,) = _field(lines, "route")
    length = float(_field(lines, "length")[0])
    stop_line = float(_field(lines, "stop_line")[0])
    must_stop = _field(lines, "must_stop") == ["1"]
    stop_lane = int(_field(lines, "stop_lane")[0])
    begin, end = _field(lines, "junction")
    first_conflict = float(_field(lines, "first_conflict")[0])
    samples = np.array([[float(token) for token in row] for row in _rows(lines, "samples")])
    if samples.shape[1] != len(Sample):
        raise ValueError(f"map: route {identity} has samples of {samples.shape[1]} values")
    return Route(identity, length, stop_line, must_stop, stop_lane, float(begin), float(end), first_conflict, samples)
