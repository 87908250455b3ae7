"""Start: the speeds that a place allows, and the constraints that a start keeps. Newcomers are placed alike."""

import math

import numpy as np

from tests.reference.closed_loop import State
from tests.reference.collisions import collisions
from tests.reference.intersection import Booleans, Map
from tests.reference.lead import lead
from tests.reference.memory import Memory
from tests.reference.observe import observe
from tests.reference.reward import SLOWEST, penalties
from tests.reference.traffic import Traffic, speed_limit

FASTEST = 4.0  # m/s², of v_hi, as SLOWEST is of v_lo: v = sqrt(2 a d)


def speed_range(intersection: Map, traffic: Traffic, i: int, distance: float) -> tuple[float, float]:
    """v_lo and v_hi of vehicle i, this far from what it must not reach [m/s]."""
    limit = speed_limit(intersection, traffic, i)
    free = max(0.0, distance)
    return min(limit, math.sqrt(2 * SLOWEST * free)), min(limit, math.sqrt(2 * FASTEST * free))


def newcomer_distance(intersection: Map, traffic: Traffic, left: Booleans, i: int) -> float:
    """d_lead of newcomer i, among who has not left and the newcomers before it; traffic: everybody seated."""
    there = ~left | (np.arange(len(left)) <= i)
    return max(0.0, lead(intersection, traffic, there, i)[1])


def violations(intersection: Map, state: State, bodies: str = "circles") -> list[str]:
    """The constraints of a start that a state violates, in words."""
    there = Memory(np.ones(len(state.delta), np.bool_), state.delta, state.hold, state.waited)
    seen = observe(intersection, state.traffic, there, np.zeros((0, 2), np.int64)).driving
    found = []
    for i, features in enumerate(seen):
        if penalties(features).violate(slow_counts=True):
            found.append(f"vehicle {i}: {penalties(features)}")
    nobody = np.zeros(len(state.delta), np.bool_)
    involved, _ = collisions(intersection, state.traffic, nobody, state.waited, bodies)
    return [*found, *(f"vehicle {i} collides" for i in np.flatnonzero(involved))]
