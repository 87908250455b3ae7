"""What a vehicle remembers, and the memories at the start."""

from dataclasses import dataclass, field

import numpy as np

from tests.reference.intersection import Booleans, Integers, Map
from tests.reference.traffic import Traffic, braking_distance, distance_to_stop_line, front


@dataclass(frozen=True)
class Memory:
    """What a vehicle remembers; each array (vehicle,).

    waited: the steps since it stopped at its line, 0 before; by default nobody has.
    """

    present: Booleans
    delta: Booleans
    hold: Integers
    waited: Integers = field(default=None)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        if self.waited is None:
            object.__setattr__(self, "waited", np.zeros(len(self.delta), np.int64))


def initial_memory(intersection: Map, traffic: Traffic) -> Memory:
    """The memories at the start."""
    count = len(traffic.route)
    present, delta = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for i in range(count):
        present[i] = traffic.position[i] < intersection.routes[traffic.route[i]].length
        delta[i] = is_under_way(intersection, traffic, i)
    return Memory(present, delta, np.full(count, -1, dtype=np.int64))


def cannot_stop(intersection: Map, traffic: Traffic, i: int) -> bool:
    """Whether the vehicle could not stop at its line any more."""
    return distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i)


def is_beyond(intersection: Map, traffic: Traffic, i: int) -> bool:
    """Whether the vehicle, once past its line, does not wait there: it drives, or is in its first conflict."""
    return bool(traffic.speed[i] >= 1 or front(traffic, i) > intersection.routes[traffic.route[i]].first_conflict)


def is_under_way(intersection: Map, traffic: Traffic, i: int) -> bool:
    """Whether the vehicle could not stop at its line any more, and does not wait beyond it."""
    return cannot_stop(intersection, traffic, i) and is_beyond(intersection, traffic, i)


def is_settled(intersection: Map, traffic: Traffic, memory: Memory, i: int) -> bool:
    """Whether the vehicle goes, by its memory, and is under way."""
    return bool(memory.delta[i]) and is_under_way(intersection, traffic, i)


def settled(intersection: Map, traffic: Traffic, memory: Memory | None) -> Booleans:
    """(vehicle,): who is settled at the start of a prediction; without memories by those of a start."""
    memory = initial_memory(intersection, traffic) if memory is None else memory
    return np.array([is_settled(intersection, traffic, memory, i) for i in range(len(traffic.route))], np.bool_)
