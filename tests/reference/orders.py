"""Crossing orders: every orientation of the pairs that can be carried out, and what an assignment implies."""

import itertools
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from tests.reference.intersection import Integers, Map
from tests.reference.memory import Memory, settled
from tests.reference.pairs import conflict_of, conflicts
from tests.reference.traffic import Traffic, distance_to_stop_line


def lane_chains(intersection: Map, traffic: Traffic, memory: Memory | None = None) -> list[list[int]]:
    """The queues at the stop lines, one list a stop lane, front vehicle first."""
    committed = settled(intersection, traffic, memory)
    queues: dict[int, list[int]] = {}
    for i in np.argsort(-traffic.position, kind="stable").tolist():
        route = intersection.routes[traffic.route[i]]
        is_waiting = distance_to_stop_line(intersection, traffic, i) >= 0 or not committed[i]
        if traffic.position[i] < route.length and is_waiting:
            queues.setdefault(route.stop_lane, []).append(i)
    return [queue for queue in queues.values() if len(queue) > 1]


def is_acyclic(edges: Collection[tuple[int, int]]) -> bool:
    """Whether a graph of (before, after) edges has an order: vehicles with nobody before them leave, until none is."""
    left = set(itertools.chain.from_iterable(edges))
    while left:
        free = {node for node in left if not any(b == node and a in left for a, b in edges)}
        if not free:
            return False
        left -= free
    return True


def acyclic_orientations(
    pairs: Sequence[tuple[int, int]], chains: Sequence[Sequence[int]], forced: Mapping[int, int]
) -> set[tuple[int, ...]]:
    """Every way to orient the pairs (+1: its first member goes first) without a cycle together with the chains.

    forced: pair number -> the only orientation tried, 0 for one that is left out.
    """
    lane_edges = [edge for chain in chains for edge in itertools.pairwise(chain)]
    choices = [(forced[number],) if number in forced else (1, -1) for number in range(len(pairs))]
    return {signs for signs in itertools.product(*choices) if is_acyclic([*lane_edges, *oriented(pairs, signs)])}


def oriented(pairs: Sequence[tuple[int, int]], signs: Sequence[int]) -> list[tuple[int, int]]:
    """(before, after) of each pair with a sign."""
    return [(i, j) if sign == 1 else (j, i) for (i, j), sign in zip(pairs, signs, strict=True) if sign != 0]


def orders(
    intersection: Map, traffic: Traffic, cooperative: Collection[int] | None = None, memory: Memory | None = None
) -> set[tuple[int, ...]]:
    """Every crossing order, as assignments (pair,) over `conflicts`, by trying all orientations."""
    pairs = [(int(i), int(j)) for i, j in conflicts(intersection, traffic)]
    committed = settled(intersection, traffic, memory)
    forced = {}
    for number, (i, j) in enumerate(pairs):
        is_chosen = cooperative is None or (i in cooperative and j in cooperative)
        if not is_chosen or (committed[i] and committed[j]):
            forced[number] = 0
        elif committed[i] or committed[j]:
            forced[number] = 1 if committed[i] else -1
    return acyclic_orientations(pairs, lane_chains(intersection, traffic, memory), forced)


def precedes(edges: Collection[tuple[int, int]], first: int, second: int) -> bool:
    """Whether a way along the (before, after) edges, which are acyclic, leads from first to second."""
    return any(after == second or precedes(edges, after, second) for before, after in edges if before == first)


def closure(pairs: Sequence[tuple[int, int]], chains: Sequence[Sequence[int]], signs: Sequence[int]) -> tuple[int, ...]:
    """The signs, with those added that follow from them and from the chains.

    Raises: ValueError if signs and chains contradict each other.
    """
    edges = [*oriented(pairs, signs), *(edge for chain in chains for edge in itertools.pairwise(chain))]
    if not is_acyclic(edges):
        raise ValueError(f"assignments: {signs} of {pairs} contradict each other or the lane order {chains}")
    return tuple(
        sign or int(precedes(edges, i, j)) - int(precedes(edges, j, i))
        for (i, j), sign in zip(pairs, signs, strict=True)
    )


def complete(intersection: Map, traffic: Traffic, assignments: Integers, memory: Memory | None = None) -> Integers:
    """Assignments (pair,) completed under lane order and transitively.

    A yielder whose centre has left the conflict makes nobody wait.

    Raises: ValueError if they contradict lane order, each other, or what a vehicle can still do.
    """
    pairs = [(int(i), int(j)) for i, j in conflicts(intersection, traffic)]
    if assignments.shape != (len(pairs),) or not np.isin(assignments, (-1, 0, 1)).all():
        raise ValueError(f"assignments: got {assignments}, wanted -1, 0 or 1 for each of {len(pairs)} pairs")
    closed = closure(pairs, lane_chains(intersection, traffic, memory), assignments.tolist())
    committed = settled(intersection, traffic, memory)
    is_fixed = [bool(committed[i] and committed[j]) for i, j in pairs]
    signs = [int(given) if fixed else sign for given, sign, fixed in zip(assignments, closed, is_fixed, strict=True)]
    for (i, j), sign in zip(pairs, signs, strict=True):
        before, after = (i, j) if sign == 1 else (j, i)
        conflict = conflict_of(intersection, traffic, i, j)
        assert conflict is not None
        has_left = sign == 1 and traffic.position[i] >= conflict.end_yielder
        if sign != 0 and committed[after] and not has_left:
            raise ValueError(f"assignments: {after} can no longer stop for {before}")
    return np.array(signs, dtype=np.int64)
