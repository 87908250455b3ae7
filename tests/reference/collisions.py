"""Collision: who touches whom, now or after braking, and who is to blame."""

from dataclasses import replace

import numpy as np

from tests.reference.bodies import body_distance, circles_distance
from tests.reference.intersection import Booleans, Conflict, Integers, Map
from tests.reference.lead import lead_gaps
from tests.reference.outputs import can_touch
from tests.reference.pairs import conflict_of
from tests.reference.traffic import Traffic, braking_distance, rear

SAFETY_DISTANCE = 0.5  # m, between the borders of two vehicles' bodies
DISTANCES = {"circles": circles_distance, "rectangles": body_distance}


def braked(traffic: Traffic) -> Traffic:
    """Everybody where full braking would end."""
    ahead = np.array([braking_distance(traffic, i) for i in range(len(traffic.route))])
    return replace(traffic, position=traffic.position + ahead)


def collide(intersection: Map, traffic: Traffic, i: int, j: int, bodies: str = "circles") -> bool:
    """Whether two vehicles collide, now or after braking."""
    distance = DISTANCES[bodies]
    return any(
        can_touch(intersection, moment, i, j) and distance(intersection, moment, i, j) < SAFETY_DISTANCE
        for moment in (traffic, braked(traffic))
    )


def yielder_before_pga(intersection: Map, traffic: Traffic, i: int, j: int) -> tuple[int, Conflict] | None:
    """Which of two vehicles yields to the other and is before its PGA, the nearer one of two; and in which conflict."""
    found = []
    for yielder, prioritized in ((i, j), (j, i)):
        conflict = conflict_of(intersection, traffic, yielder, prioritized)
        if conflict is not None and rear(traffic, yielder) < conflict.end_yielder:
            found.append((conflict.end_yielder - rear(traffic, yielder), yielder, conflict))
    return min(found, key=lambda one: one[0])[1:] if found else None


def to_blame(intersection: Map, traffic: Traffic, waited: Integers, i: int, j: int) -> set[int]:
    """Which of two colliding vehicles is to blame."""
    found = yielder_before_pga(intersection, traffic, i, j)
    if found is not None:
        yielder, conflict = found
        if conflict.by_arrival and waited[i] != waited[j]:
            return {i if waited[i] < waited[j] else j}
        return {yielder}
    for behind, ahead in ((i, j), (j, i)):
        if lead_gaps(intersection, traffic, behind, ahead):
            return {behind}
    return {i, j}


def collisions(
    intersection: Map, traffic: Traffic, is_new: Booleans, waited: Integers, bodies: str = "circles"
) -> tuple[Booleans, Booleans]:
    """Who collides with anybody, and who is to blame for it; both (vehicle,). Nobody is, where one has just come."""
    count = len(traffic.route)
    involved, blamed = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    for i in range(count):
        for j in range(i + 1, count):
            if collide(intersection, traffic, i, j, bodies):
                involved[[i, j]] = True
                if not (is_new[i] or is_new[j]):
                    blamed[list(to_blame(intersection, traffic, waited, i, j))] = True
    return involved, blamed
