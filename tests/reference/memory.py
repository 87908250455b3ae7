"""What a vehicle remembers, and the memories at the start."""

from dataclasses import dataclass

import numpy as np

from tests.reference.intersection import Booleans, Integers, Map
from tests.reference.traffic import Traffic, braking_distance, distance_to_stop_line, front


@dataclass(frozen=True)
class Memory:
    """What a vehicle remembers; each array (vehicle,)."""

    present: Booleans
    delta: Booleans
    hold: Integers


def initial_memory(intersection: Map, traffic: Traffic) -> Memory:
    """The memories at the start."""
    count = len(traffic.route)
    present, delta = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for i in range(count):
        route = intersection.routes[traffic.route[i]]
        present[i] = traffic.position[i] < route.length
        cannot_stop = distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i)
        delta[i] = cannot_stop and (traffic.speed[i] >= 1 or front(traffic, i) > route.first_conflict)
    return Memory(present, delta, np.full(count, -1, dtype=np.int64))


def is_settled(intersection: Map, traffic: Traffic, memory: Memory, i: int) -> bool:
    """Whether the vehicle goes, by its memory, and could not stop at its line any more."""
    cannot_stop = distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i)
    return bool(memory.delta[i]) and cannot_stop


def settled(intersection: Map, traffic: Traffic, memory: Memory | None) -> Booleans:
    """(vehicle,): who is settled at the start of a prediction; without memories by those of a start."""
    memory = initial_memory(intersection, traffic) if memory is None else memory
    return np.array([is_settled(intersection, traffic, memory, i) for i in range(len(traffic.route))], np.bool_)
