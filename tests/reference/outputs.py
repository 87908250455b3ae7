"""Outputs: time loss, how near to each other two bodies are where they can touch, whether an order is followed."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from tests.reference.bodies import body_distance
from tests.reference.intersection import Booleans, Floats, Integers, Map
from tests.reference.pairs import conflict_of
from tests.reference.traffic import TIME_STEP, Traffic, front, rear, speed_limit


def time_loss(intersection: Map, states: Sequence[Traffic], presences: Sequence[Booleans]) -> Floats:
    """(vehicle,) [s], over the states at which steps begin."""
    loss = np.zeros(len(states[0].route))
    for state, present in zip(states, presences, strict=True):
        for i in np.flatnonzero(present).tolist():
            loss[i] += TIME_STEP * (1 - state.speed[i] / speed_limit(intersection, state, i))
    return loss


def can_touch(intersection: Map, traffic: Traffic, i: int, j: int) -> bool:
    """Whether both are on one route, or both bodies meet an interval in which their routes overlap."""
    if traffic.route[i] == traffic.route[j]:
        return True
    for overlap in intersection.overlaps:
        for a, b in ((i, j), (j, i)):
            if (traffic.route[a], traffic.route[b]) == (overlap.a, overlap.b):
                meets_a = rear(traffic, a) <= overlap.end_a and front(traffic, a) >= overlap.begin_a
                meets_b = rear(traffic, b) <= overlap.end_b and front(traffic, b) >= overlap.begin_b
                if meets_a and meets_b:
                    return True
    return False


def overlapping(intersection: Map, traffic: Traffic) -> set[tuple[int, int]]:
    """The pairs of vehicles whose bodies overlap."""
    return {
        (i, j)
        for i, j in itertools.combinations(range(len(traffic.route)), 2)
        if can_touch(intersection, traffic, i, j) and body_distance(intersection, traffic, i, j) == 0.0
    }


def minimum_distance(intersection: Map, traffic: Traffic, present: Booleans, apart: set[tuple[int, int]]) -> float:
    """Over all pairs of present vehicles that can touch, but those `apart`; infinite without any."""
    return min(
        (
            body_distance(intersection, traffic, i, j)
            for i, j in itertools.combinations(np.flatnonzero(present).tolist(), 2)
            if (i, j) not in apart and can_touch(intersection, traffic, i, j)
        ),
        default=math.inf,
    )


def followed(
    intersection: Map, traffic: Traffic, pairs: Integers, assignments: Integers, position: Floats, present: Booleans
) -> Booleans:
    """(scenario,): in the states (scenario, time, vehicle) nobody enters before the one that is assigned to go first.

    traffic: whose routes and lengths count; pairs: (pair, 2); assignments: (scenario, pair), completed.
    """
    result = np.ones(len(assignments), np.bool_)
    front, behind = position + traffic.length / 2, position - traffic.length / 2
    for number, (i, j) in enumerate(pairs.tolist()):
        conflict = conflict_of(intersection, traffic, i, j)
        assert conflict is not None
        there = present[..., i] & present[..., j]
        for way, second, first, begin, end, first_end in (
            (-1, i, j, conflict.begin_yielder, conflict.end_yielder, conflict.end_prioritized),
            (1, j, i, conflict.begin_prioritized, conflict.end_prioritized, conflict.end_yielder),
        ):
            entry = max(begin, intersection.routes[traffic.route[second]].stop_line) + 0.1
            active = there & (behind[..., second] < end) & (position[..., first] < first_end)
            result &= ~((assignments[:, number] == way) & (active & (front[..., second] > entry)).any(axis=-1))
    return result
