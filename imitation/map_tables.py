"""What compiled maps say of their routes, as tensors to look up in; the routes of several maps stand in one row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from intersection_env import _core
from intersection_env.maps.intersection import Intersection, Sample

NOWHERE = -1e6  # [m], behind every start; finite, as gradients of what is not used must be


@dataclass(frozen=True, eq=False)
class MapTables:
    """Tables of all routes, read from the core's maps.

    begin: of each map by checksum, the place of its first route in the row.
    rank, route_count: (route,) its rank on its own map, and how many routes that has.
    stop_line, first_conflict, length: (route,) [m]. must_stop: (route,) bool, before that line. stop_lane: (route,), no
        two maps share one.
    lane_begin, lane_end, offset: (route, route, lane) how a vehicle on the row's route follows one on the column's in a
        lane that they share: once that one's front is beyond its begin, and until one of their rears is at its end, on
        the row's route, that one's position being more by the offset [m].
    on_yielder, on_prioritized: (2, route, route) [m], begin and end of the conflict in which the row's route yields to
        the column's, on the one and on the other; `NOWHERE` where they have none. beyond_line: (route, route) [m], by
        how much its line is beyond the stop line of the one that has priority.
    """

    begin: dict[str, int]
    rank: Tensor
    route_count: Tensor
    stop_line: Tensor
    first_conflict: Tensor
    length: Tensor
    must_stop: Tensor
    stop_lane: Tensor
    lane_begin: Tensor
    lane_end: Tensor
    offset: Tensor
    on_yielder: Tensor
    on_prioritized: Tensor
    beyond_line: Tensor
    _first: Tensor
    _last: Tensor
    _samples: Tensor
    _inverse_spacing: Tensor

    @classmethod
    def of(cls, maps: Sequence[Intersection]) -> MapTables:
        """The tables of some maps, each once.

        Raises:
            ValueError: a map with an all-way stop, of which the model in torch knows nothing.
        """
        for one in maps:
            if any(conflict.by_arrival for conflict in one.conflicts):
                raise ValueError(f'map "{one.name}" has an all-way stop, which the model in torch does not know')
        cores = [one.core for one in maps]
        counts = [len(core.routes) for core in cores]
        begins = [0, *np.cumsum(counts).tolist()]
        routes = [route for core in cores for route in core.routes]
        rows = [route.sample_count for route in routes]
        lanes = [[route.stop_lane for route in core.routes] for core in cores]
        first_lanes = np.cumsum([0, *(max(own) + 1 for own in lanes)]).tolist()
        return cls(
            begin=dict(zip([one.checksum for one in maps], begins, strict=False)),
            rank=torch.tensor([route.rank for route in routes]),
            route_count=torch.tensor([count for count in counts for _ in range(count)]),
            stop_line=torch.tensor([route.stop_line for route in routes]),
            first_conflict=torch.tensor([route.first_conflict for route in routes]),
            length=torch.tensor([route.length for route in routes]),
            must_stop=torch.tensor([route.must_stop for route in routes]),
            stop_lane=torch.tensor(
                [first + lane for first, own in zip(first_lanes, lanes, strict=False) for lane in own]
            ),
            **_following(cores, begins),
            **_conflicts(cores, begins),
            _first=torch.tensor([0, *np.cumsum(rows)[:-1].tolist()]),
            _last=torch.tensor(rows) - 1,
            _samples=torch.cat([_samples(core, route) for core in cores for route in range(len(core.routes))]),
            _inverse_spacing=torch.tensor([1.0 / core.spacing for core in cores for _ in core.routes]),
        )

    def road(self, route: Tensor, position: Tensor) -> tuple[Tensor, Tensor]:
        """v_max of the map [m/s] and the six relative headings (..., 6) [rad] where vehicles are on their routes."""
        last = self._last[route]
        at = (position * self._inverse_spacing[route]).clamp(min=0.0).minimum(last.float())
        row = at.long().minimum(last - 1)
        place = self._first[route] + row
        below = self._samples[place]
        between = below + (at - row).unsqueeze(-1) * (self._samples[place + 1] - below)
        return between[..., 0], between[..., 1:]


def _samples(core: _core.Map, route: int) -> Tensor:
    """(sample, 7): v_max and the relative headings."""
    grid = np.arange(core.routes[route].sample_count, dtype=np.float32) * np.float32(core.spacing)
    samples = core.sample(route, grid)
    columns = [Sample.V_MAX, *range(Sample.HEADINGS, samples.shape[1])]
    return torch.from_numpy(np.ascontiguousarray(samples[:, columns]))


def _following(cores: Sequence[_core.Map], begins: Sequence[int]) -> dict[str, Tensor]:
    count, most = begins[-1], 1
    seen: dict[tuple[int, int], int] = {}
    rows = []
    for core, first in zip(cores, begins, strict=False):
        for a, b, begin_a, begin_b, end, further in core.shared_lanes:
            i, j = first + a, first + b
            lane = seen[i, j] = seen.get((i, j), -1) + 1
            most = max(most, lane + 1)
            rows.append((i, j, lane, begin_b, end, further))
            rows.append((j, i, lane, begin_a, end + further, -further))
    begin, last = torch.full((2, count, count, most), -torch.inf)
    offset = torch.zeros(count, count, most)
    last[range(count), range(count), 0] = torch.inf
    for i, j, lane, from_, until, further in rows:
        begin[i, j, lane], last[i, j, lane], offset[i, j, lane] = from_, until, further
    return {"lane_begin": begin, "lane_end": last, "offset": offset}


def _conflicts(cores: Sequence[_core.Map], begins: Sequence[int]) -> dict[str, Tensor]:
    on_yielder, on_prioritized = torch.full((2, 2, begins[-1], begins[-1]), NOWHERE)
    beyond_line = torch.zeros(begins[-1], begins[-1])
    for core, begin in zip(cores, begins, strict=False):
        for yielder, prioritized, _, _, *ends, line in core.conflicts:
            i, j = begin + yielder, begin + prioritized
            on_yielder[:, i, j], on_prioritized[:, i, j] = torch.tensor(ends).view(2, 2)
            beyond_line[i, j] = line - core.routes[prioritized].stop_line
    return {"on_yielder": on_yielder, "on_prioritized": on_prioritized, "beyond_line": beyond_line}
