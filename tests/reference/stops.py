"""Stops: who has stopped at its line, who still has to, and who goes first at an all-way stop."""

from dataclasses import replace

import numpy as np

from tests.reference.intersection import Booleans, Map
from tests.reference.memory import Memory, cannot_stop, is_settled
from tests.reference.traffic import Traffic, distance_to_stop_line

STOPPED = 0.5  # m/s, slower than this a vehicle has stopped
AT_LINE = 3.0  # m, before its line


def with_stops(intersection: Map, traffic: Traffic, memory: Memory) -> Memory:
    """The memory with what has been waited by now."""
    waited = memory.waited.copy()
    for i in np.flatnonzero(memory.present).tolist():
        stops = (
            intersection.routes[traffic.route[i]].must_stop
            and traffic.speed[i] < STOPPED
            and distance_to_stop_line(intersection, traffic, i) < AT_LINE
        )
        waited[i] += waited[i] > 0 or stops
    return replace(memory, waited=waited)


def still_to_stop(intersection: Map, traffic: Traffic, memory: Memory) -> Booleans:
    """(vehicle,): who has to stop, has not, and is before its line."""
    return np.array(
        [
            intersection.routes[traffic.route[i]].must_stop
            and memory.waited[i] == 0
            and distance_to_stop_line(intersection, traffic, i) >= 0
            for i in range(len(traffic.route))
        ],
        np.bool_,
    )


def turn(intersection: Map, traffic: Traffic, memory: Memory, i: int) -> tuple[int, int]:
    """When a vehicle goes at an all-way stop; the greater goes first."""
    if is_settled(intersection, traffic, memory, i):
        return (3, 0)
    if cannot_stop(intersection, traffic, i):
        return (2, 0)
    is_told = memory.hold[i] == len(intersection.routes)
    return (0 if is_told else 1, int(memory.waited[i]))


def by_arrival(intersection: Map, traffic: Traffic, memory: Memory, i: int, j: int) -> int:
    """Of i, which yields to j on a tie, and j: +1 where i goes first, -1 where j does."""
    mine, other = turn(intersection, traffic, memory, i), turn(intersection, traffic, memory, j)
    goes_first = mine > other or (mine == other and memory.hold[j] > intersection.ranks[traffic.route[i]])
    return 1 if goes_first else -1
