"""Collision: who touches whom, now or after braking, and who is to blame."""

from dataclasses import replace

import numpy as np

from tests.reference.bodies import circles_distance
from tests.reference.intersection import Booleans, Map
from tests.reference.lead import lead_gaps
from tests.reference.outputs import can_touch
from tests.reference.pairs import conflict_of
from tests.reference.traffic import Traffic, braking_distance, rear

SAFETY_DISTANCE = 0.5  # m, between the borders of two vehicles' circles


def braked(traffic: Traffic) -> Traffic:
    """Everybody where full braking would end."""
    ahead = np.array([braking_distance(traffic, i) for i in range(len(traffic.route))])
    return replace(traffic, position=traffic.position + ahead)


def collide(intersection: Map, traffic: Traffic, i: int, j: int) -> bool:
    """Whether two vehicles collide, now or after braking."""
    return any(
        can_touch(intersection, moment, i, j) and circles_distance(intersection, moment, i, j) < SAFETY_DISTANCE
        for moment in (traffic, braked(traffic))
    )


def to_blame(intersection: Map, traffic: Traffic, i: int, j: int) -> set[int]:
    """Which of two colliding vehicles is to blame."""
    for yielder, prioritized in ((i, j), (j, i)):
        conflict = conflict_of(intersection, traffic, yielder, prioritized)
        if conflict is not None and rear(traffic, yielder) < conflict.end_yielder:
            return {yielder}
    for behind, ahead in ((i, j), (j, i)):
        if lead_gaps(intersection, traffic, behind, ahead):
            return {behind}
    return {i, j}


def collisions(intersection: Map, traffic: Traffic, is_new: Booleans) -> tuple[Booleans, Booleans]:
    """Who collides with anybody, and who is to blame for it; both (vehicle,). Nobody is, where one has just come."""
    count = len(traffic.route)
    involved, blamed = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    for i in range(count):
        for j in range(i + 1, count):
            if collide(intersection, traffic, i, j):
                involved[[i, j]] = True
                if not (is_new[i] or is_new[j]):
                    blamed[list(to_blame(intersection, traffic, i, j))] = True
    return involved, blamed
