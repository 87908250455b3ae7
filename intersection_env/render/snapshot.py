"""What is drawn: vehicles at one moment, and what holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


def _no_pairs() -> NDArray[np.int32]:
    return np.zeros((0, 2), np.int32)


@dataclass(frozen=True, eq=False)
class Ghosts:
    """Vehicles as they were recorded, drawn as translucent outlines.

    route: (vehicle,) int32; position: (vehicle,) float32, of the centre along the route [m]; length, width:
    (vehicle,) float32 [m].
    """

    route: NDArray[np.int32]
    position: NDArray[np.float32]
    length: NDArray[np.float32]
    width: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What is drawn: the vehicles of a world, and what holds them.

    route: (vehicle,) int32; position: (vehicle,) float32, of the centre along the route [m]; speed, v_max:
    (vehicle,) float32 [m/s], colours go from standing (or backing) to v_max (or faster); length, width:
    (vehicle,) float32 [m]; enters: (vehicle,) bool, the gap decision; waits_for: (pair, 2) indices of one that
    waits and the one it waits for; assigned: (pair, 2) indices of the second and the first of a priority assignment.
    """

    route: NDArray[np.int32]
    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    length: NDArray[np.float32]
    width: NDArray[np.float32]
    v_max: NDArray[np.float32]
    enters: NDArray[np.bool_]
    waits_for: NDArray[np.integer] = field(default_factory=_no_pairs)
    assigned: NDArray[np.integer] = field(default_factory=_no_pairs)
    ghosts: Ghosts | None = None
    labels: Sequence[str] | None = None
    """(vehicle,) written beside them."""
    highlight: int | None = None
    """Index of the acting vehicle."""
    time: float | None = None
    """[s], written in a corner."""
    caption: str | None = None
    """A line below the time."""
