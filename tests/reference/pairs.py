"""Pairs: who yields to whom, and for how long."""

import numpy as np

from tests.reference.intersection import Booleans, Conflict, Integers, Map
from tests.reference.traffic import Traffic, rear


def conflict_of(intersection: Map, traffic: Traffic, i: int, j: int) -> Conflict | None:
    """The conflict in which i's route yields to j's."""
    for conflict in intersection.conflicts:
        if (conflict.yielder, conflict.prioritized) == (traffic.route[i], traffic.route[j]):
            return conflict
    return None


def all_pairs(intersection: Map, traffic: Traffic) -> Integers:
    """(pair, 2): every yielder i and prioritized j by their routes, sorted by i, then j."""
    vehicles = range(len(traffic.route))
    found = [(i, j) for i in vehicles for j in vehicles if conflict_of(intersection, traffic, i, j) is not None]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def conflicts(intersection: Map, traffic: Traffic) -> Integers:
    """(pair, 2): those of all pairs that are still to meet."""
    open_pairs = []
    for i, j in all_pairs(intersection, traffic).tolist():
        conflict = conflict_of(intersection, traffic, i, j)
        assert conflict is not None
        if rear(traffic, i) < conflict.end_yielder and traffic.position[j] < conflict.end_prioritized:
            open_pairs.append((i, j))
    return np.array(open_pairs, dtype=np.int64).reshape(-1, 2)


def is_active(intersection: Map, traffic: Traffic, present: Booleans, pair: Integers, assignment: int) -> bool:
    """Whether the second of a pair (2,) is still to let the first pass."""
    i, j = int(pair[0]), int(pair[1])
    conflict = conflict_of(intersection, traffic, i, j)
    assert conflict is not None
    if not (present[i] and present[j]):
        return False
    if assignment == 1:
        return rear(traffic, j) < conflict.end_prioritized and bool(traffic.position[i] < conflict.end_yielder)
    return rear(traffic, i) < conflict.end_yielder and bool(traffic.position[j] < conflict.end_prioritized)
