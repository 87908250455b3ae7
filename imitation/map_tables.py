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
    number, route_count: (route,) its index on its own map, and how many routes that has.
    stop_line, length: (route,) [m]. stop_lane: (route,), no two maps share one.
    split, merge, offset: (route, route) how a vehicle on the row's route follows one on the column's: before the split,
        or once that one's front is beyond the merge; at equal arc lengths, or with this offset [m].
    own_begin, own_end: (route, route) [m], the conflict's interval on the row's route with the column's; `NOWHERE`
        where they have none.
    """

    begin: dict[str, int]
    number: Tensor
    route_count: Tensor
    stop_line: Tensor
    length: Tensor
    stop_lane: Tensor
    split: Tensor
    merge: Tensor
    offset: Tensor
    own_begin: Tensor
    own_end: Tensor
    _first: Tensor
    _last: Tensor
    _samples: Tensor
    _inverse_spacing: Tensor

    @classmethod
    def of(cls, maps: Sequence[Intersection]) -> MapTables:
        """The tables of some maps, each once."""
        cores = [one.core for one in maps]
        counts = [len(core.routes) for core in cores]
        begins = [0, *np.cumsum(counts).tolist()]
        routes = [route for core in cores for route in core.routes]
        rows = [route.sample_count for route in routes]
        lanes = [[route.stop_lane for route in core.routes] for core in cores]
        first_lanes = np.cumsum([0, *(max(own) + 1 for own in lanes)]).tolist()
        return cls(
            begin=dict(zip([one.checksum for one in maps], begins, strict=False)),
            number=torch.tensor([index for count in counts for index in range(count)]),
            route_count=torch.tensor([count for count in counts for _ in range(count)]),
            stop_line=torch.tensor([route.stop_line for route in routes]),
            length=torch.tensor([route.length for route in routes]),
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
    count = begins[-1]
    split, merge = torch.full((count, count), -torch.inf), torch.full((count, count), torch.inf)
    offset = torch.zeros(count, count)
    split.fill_diagonal_(torch.inf)
    for core, begin in zip(cores, begins, strict=False):
        for a, b, entry, merge_a, merge_b, further in core.shared_lanes:
            i, j = begin + a, begin + b
            if entry > 0.0:
                split[i, j] = split[j, i] = entry
            else:
                merge[i, j], merge[j, i] = merge_b, merge_a
                offset[i, j], offset[j, i] = further, -further
    return {"split": split, "merge": merge, "offset": offset}


def _conflicts(cores: Sequence[_core.Map], begins: Sequence[int]) -> dict[str, Tensor]:
    own_begin, own_end = torch.full((2, begins[-1], begins[-1]), NOWHERE)
    for core, begin in zip(cores, begins, strict=False):
        for yielder, prioritized, _, *on_yielder, first, last in core.conflicts:
            i, j = begin + yielder, begin + prioritized
            own_begin[i, j], own_end[i, j] = on_yielder
            own_begin[j, i], own_end[j, i] = first, last
    return {"own_begin": own_begin, "own_end": own_end}
