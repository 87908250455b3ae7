"""An intersection: its routes, and how they meet."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import file_there, name_or_file
from intersection_env.maps.meeting import Conflict, SharedLane
from intersection_env.maps.name import check_name

MAPS = Path(__file__).parent


def shipped_maps() -> tuple[str, ...]:
    """The names of the maps that ship, in order."""
    return tuple(sorted(path.stem for path in MAPS.glob("*.map")))


def recorded_maps() -> tuple[str, ...]:
    """Those of them on which recordings lie: what drivers learn on, and are judged on, by default."""
    return tuple(name for name in shipped_maps() if Intersection.load(name).locations)


class Sample(IntEnum):
    """Columns of `Route.samples` and of `Intersection.sample`.

    HEADINGS is the first of six: relative headings at -10, -3, 3, 10, 30 and 100 m.
    """

    X = 0
    Y = 1
    HEADING = 2
    WIDTH = 3
    V_MAX = 4
    HEADINGS = 5


XY = slice(Sample.X, Sample.Y + 1)
"""Both columns of a place."""


@dataclass(frozen=True)
class Route:
    """A way from one arm to another; all lengths are arc lengths of its centreline [m]."""

    index: int
    id: str
    length: float
    stop_line: float
    must_stop: bool
    """Whether a stop is made before that line."""
    stop_lane: int
    """Routes with equal index queue in one lane before their stop lines."""
    rank: int
    """No two routes have the same, from 0; who waits itself holds up only yielders of its rank or above it."""
    junction: tuple[float, float]
    """Where the approach ends and where the exit lane begins."""
    first_conflict: float
    samples: NDArray[np.float32]
    """(sample, 11), columns `Sample`: x, y [m], heading [rad, unwrapped], lane width [m], v_max [m/s], relative
    heading at the six offsets [rad]; one sample every `Intersection.spacing`, the last at or beyond the end."""

    @property
    def entry(self) -> str:
        """The arm from which it comes."""
        return self.id.partition("-")[0]

    @property
    def exit(self) -> str:
        """The arm into which it leads."""
        return self.id.partition("-")[2].partition(".")[0]


class Place(NamedTuple):
    """A place on a route, as `Vehicle` takes it."""

    route: str
    """The route's id."""
    position: float
    """Arc length along it [m]."""
    left: float
    """Lateral offset from its centreline, to the left [m]."""
    turn: float
    """Heading less the route's, counter-clockwise, from -pi to pi [rad]."""


class Intersection:
    """A compiled map. Equal maps have equal checksums.

    Attributes:
        name: the map's name.
        locations: inD location ids whose recordings lie on this map.
        checksum: of the compiled map, eight hex digits.
        spacing: grid of the routes' samples [m].
        routes: in the order of their indices.
        core: the map as the core holds it.
        text: of the compiled map.
    """

    def __init__(self, text: str, where: str) -> None:
        """Reads the text of a compiled map; `where` names it in errors (use `load` for files)."""
        self.text, self._where = text, where
        self.core = _core.Map(text, where)
        try:
            self.name = check_name(self.core.name)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        self.locations: tuple[int, ...] = tuple(self.core.locations)
        self.checksum = f"{self.core.checksum:08x}"
        self.spacing: float = self.core.spacing
        self.routes = tuple(self._route(index) for index in range(len(self.core.routes)))

    @classmethod
    def load(cls, name_or_path: str | Path) -> Intersection:
        """A map that ships (`"bendplatz"`, `"t_junction"`), a compiled map (`.map`) or a map source (`.json`).

        Raises:
            TypeError: neither a name nor a path.
            ValueError: no map of that name ships, or the file is damaged or contradicts itself.
            OSError: the file is not there, or cannot be read.
        """
        path = name_or_file("map", name_or_path, shipped_maps())
        if path.suffix in (".json", ".map"):
            file_there("map", path, shipped_maps())
        if path.suffix == ".json":
            from intersection_env.maps.compiler import compile_file

            return cls(compile_file(path), str(path))
        if path.suffix != ".map":
            if str(name_or_path) not in shipped_maps():
                raise ValueError(
                    f'no map "{name_or_path}" ships (there are {", ".join(shipped_maps())});'
                    " a file must end in .map (compiled) or .json (source)"
                )
            path = MAPS / f"{name_or_path}.map"
        try:
            return cls(path.read_text(encoding="utf-8"), str(path))
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: is not text: {error}") from None

    def route_index(self, route_id: str) -> int:
        """The index of a route, by its id.

        Raises:
            ValueError: the map has no such route.
        """
        for route in self.routes:
            if route.id == route_id:
                return route.index
        raise ValueError(
            f'{self.name} has no route "{route_id}"; its routes are {", ".join(route.id for route in self.routes)}'
        )

    def locate(
        self, x: float, y: float, heading: float, *, aside: float = _core.ASIDE, turned: float = _core.TURNED
    ) -> tuple[Place, ...]:
        """Where on which routes something may be, from where it is on the ground: the routes that fit.

        The smallest offset comes first; where routes share a lane, all of them fit equally, in their order.

        Args:
            x, y: of the centre, in the map's metres.
            heading: counter-clockwise from the x axis [rad].
            aside: the largest distance from a centreline [m]; in lanes wider than 3.5 m, of what these do not leave
                free.
            turned: the largest difference of headings [rad].

        Raises:
            ValueError: what is no number.
        """
        rows = self.core.locate(x, y, heading, aside, turned)
        return tuple(Place(self.routes[route].id, *values) for route, *values in rows)

    def sample(self, route: int, position: NDArray[np.float32]) -> NDArray[np.float32]:
        """The columns of `Route.samples` at arc lengths `position` (n,), interpolated: (n, 11)."""
        return self.core.sample(route, position)

    def sample_each(self, route: NDArray[np.integer], position: NDArray[np.float32]) -> NDArray[np.float32]:
        """The same at one place on each of some routes, given by their indices and arc lengths (n,) [m]: (n, 11)."""
        samples = np.empty((len(route), self.routes[0].samples.shape[1]), np.float32)
        for row, (one, at) in enumerate(zip(route.tolist(), position[:, None], strict=True)):
            samples[row] = self.core.sample(one, at)[0]
        return samples

    @cached_property
    def conflicts(self) -> tuple[Conflict, ...]:
        """All pairs of routes whose swept areas overlap outside of the lanes that they share."""
        return tuple(Conflict(y, p, m, t, (a, b), (c, d), e) for y, p, m, t, a, b, c, d, e in self.core.conflicts)

    @cached_property
    def shared_lanes(self) -> tuple[SharedLane, ...]:
        """All lanes that two routes share, a < b."""
        return tuple(SharedLane(*row) for row in self.core.shared_lanes)

    def _route(self, index: int) -> Route:
        core = self.core.routes[index]
        grid = np.float32(self.spacing) * np.arange(core.sample_count, dtype=np.float32)
        samples = self.core.sample(index, grid)
        samples.setflags(write=False)
        return Route(
            index,
            core.id,
            core.length,
            core.stop_line,
            core.must_stop,
            core.stop_lane,
            core.rank,
            core.junction,
            core.first_conflict,
            samples,
        )

    def __repr__(self) -> str:
        return f"Intersection({self.name!r}, {len(self.routes)} routes, checksum {self.checksum})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Intersection) and self.checksum == other.checksum

    def __hash__(self) -> int:
        return hash(self.checksum)

    def __reduce__(self) -> tuple[type[Intersection], tuple[str, str]]:
        return Intersection, (self.text, self._where)
