"""What the networks see: their features, of vehicles and of pairs."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tests.reference.intersection import HEADINGS, Floats, Integers, Map, sample
from tests.reference.lead import lead
from tests.reference.memory import Memory, initial_memory
from tests.reference.pairs import conflict_of, conflicts
from tests.reference.traffic import FIELDS, Traffic, distance_to_stop_line, front, rear, speed_limit


class Feature(IntEnum):
    """Columns of the driving features; those between v_max and d_lead are the relative headings."""

    D_STOP = 0
    SPEED = 1
    V_MAX = 2
    D_LEAD = 9
    V_LEAD = 10
    DELTA = 11


@dataclass(frozen=True)
class Observation:
    """driving: (vehicle, 12); gap: (pair, 4)."""

    driving: Floats
    gap: Floats


def observe(
    intersection: Map, traffic: Traffic, memory: Memory | None = None, pairs: Integers | None = None
) -> Observation:
    """What the networks see now; memory and pairs default to those of a start at this moment.

    driving: d_stop, v, v_max, headings at -10, -3, 3, 10, 30, 100 m, d_lead, v_lead, delta.
    gap: d_PGA of the yielder, its v, how far the prioritized is from the conflict's line, its v.
    """
    memory = initial_memory(intersection, traffic) if memory is None else memory
    pairs = conflicts(intersection, traffic) if pairs is None else pairs
    driving, gap = np.zeros((len(traffic.route), 12)), np.zeros((len(pairs), 4))
    for i in range(len(traffic.route)):
        headings = sample(intersection, int(traffic.route[i]), float(traffic.position[i]))[HEADINGS]
        _, distance, speed = lead(intersection, traffic, memory.present, i)
        own = [distance_to_stop_line(intersection, traffic, i), traffic.speed[i], speed_limit(intersection, traffic, i)]
        driving[i] = [*own, *headings, distance, speed, float(memory.delta[i])]
    for number, (i, j) in enumerate(pairs):
        conflict = conflict_of(intersection, traffic, i, j)
        assert conflict is not None
        to_guarantee = conflict.end_yielder - rear(traffic, i)
        gap[number] = to_guarantee, traffic.speed[i], conflict.line - front(traffic, j), traffic.speed[j]
    return Observation(driving, gap)


def alone(intersection: Map, traffic: Traffic, i: int) -> Floats:
    """(12,): what vehicle i sees with nobody else there, entering."""
    only = Traffic(*(getattr(traffic, name)[[i]] for name in FIELDS))
    there = Memory(np.ones(1, np.bool_), np.ones(1, np.bool_), np.array([-1]))
    return np.asarray(observe(intersection, only, there, np.zeros((0, 2), np.int64)).driving[0])
