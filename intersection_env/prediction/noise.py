"""Perception that errs: traffic drawn anew around what was seen, and what a draw says of the pairs that were seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from intersection_env.arguments import whole_number
from intersection_env.traffic import Traffic


@dataclass(frozen=True)
class Noise:
    """What perception errs by: deviations of normal errors of each vehicle's position [m] and speed [m/s]."""

    position: float = 0.5
    speed: float = 0.5
    draws: int = 16
    """Traffics that are drawn; a forecast is their average."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("position", "speed"):
            value = getattr(self, name)
            if not isinstance(value, int | float | np.floating) or not 0.0 <= value < np.inf:
                raise ValueError(f"{name} must be a deviation from 0 on, not {value!r}")
        if whole_number("draws", self.draws) < 1:
            raise ValueError(f"draws must be at least 1, not {self.draws}")
        if whole_number("seed", self.seed) < 0:
            raise ValueError(f"seed must not be negative, not {self.seed}")


def drawn(traffic: Traffic, noise: Noise, generator: np.random.Generator) -> Traffic:
    """The traffic with errors, cut at the routes' ends and at a standstill.

    Raises:
        ValueError: vehicles overlap in it that do not in the traffic.
    """
    length = np.array([traffic.intersection.routes[route].length for route in traffic.route.tolist()])
    position = np.clip(traffic.position + noise.position * generator.normal(size=len(traffic)), 0.0, length)
    speed = np.maximum(traffic.speed + noise.speed * generator.normal(size=len(traffic)), 0.0)
    erring = position.astype(np.float32), speed.astype(np.float32)
    other = replace(traffic, position=erring[0], speed=erring[1], doubting=False)  # doubted where it was given
    if set(other.overlaps) - set(traffic.overlaps):
        raise ValueError("vehicles {} and {} overlap".format(*other.overlaps[0]))
    return other


def still_open(traffic: Traffic, priorities: tuple[tuple[str, str], ...]) -> NDArray[np.int8]:
    """(pair,): of priorities (first, second) in another draw those whose pairs are open in this one too."""
    pairs = {(traffic.ids[i], traffic.ids[j]) for i, j in traffic.conflicts.tolist()}
    return traffic.assign([pair for pair in priorities if pair in pairs or pair[::-1] in pairs])


def on_pairs(
    traffic: Traffic, draw: Traffic, orders: NDArray[np.int8], yielder_first: NDArray[np.float64]
) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
    """A draw's orders (order, pair) and `yielder_first` (pair,) on the traffic's own pairs.

    A pair that is over in the draw, as the one is past the conflict, has gone as it has gone: the other was second.
    """
    place = {tuple(pair): k for k, pair in enumerate(draw.conflicts.tolist())}
    mapped = np.zeros((len(orders), len(traffic.conflicts)), np.int8)
    first = np.zeros(len(traffic.conflicts))
    for k, pair in enumerate(traffic.conflicts.tolist()):
        if tuple(pair) in place:
            mapped[:, k] = orders[:, place[tuple(pair)]]
            first[k] = yielder_first[place[tuple(pair)]]
        else:
            first[k] = float(_is_past(draw, *pair))
            mapped[:, k] = 1 if first[k] else -1
    return mapped, first


def _is_past(traffic: Traffic, yielder: int, prioritized: int) -> bool:
    """Of a pair that is no longer open, whether the yielder is past the conflict."""
    routes = int(traffic.route[yielder]), int(traffic.route[prioritized])
    conflict = next(one for one in traffic.intersection.conflicts if (one.yielder, one.prioritized) == routes)
    return bool(traffic.position[yielder] - 0.5 * traffic.length[yielder] >= conflict.on_yielder[1])
