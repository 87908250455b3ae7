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
