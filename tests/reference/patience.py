"""Patience: the logit that a gap's must exceed before a driver who keeps its quantile accepts it."""

import math

import numpy as np

from tests.reference.intersection import Floats, Map
from tests.reference.memory import Memory, initial_memory
from tests.reference.networks import Network, evaluate
from tests.reference.observe import observe
from tests.reference.pairs import conflicts
from tests.reference.traffic import Traffic, distance_to_stop_line

STANDING = 0.1  # m/s
AT_LINE = 5.0  # m


def patience(
    intersection: Map, traffic: Traffic, network: Network, levels: Floats, memory: Memory | None = None
) -> Floats:
    """(vehicle,), of the driver at each vehicle's level (vehicle,)."""
    memory = initial_memory(intersection, traffic) if memory is None else memory
    pairs = conflicts(intersection, traffic)
    features = observe(intersection, traffic, memory, pairs).gap
    result = []
    for i, level in enumerate(levels.tolist()):
        chances = [
            1.0 / (1.0 + math.exp(-evaluate(network, row, "leaky_relu")))
            for pair, row in zip(pairs, features, strict=True)
            if pair[0] == i and memory.hold[pair[1]] <= intersection.ranks[traffic.route[i]]
        ]
        refused = min(chances) if chances and waits(intersection, traffic, memory, i) else 0.0
        quantile = refused + level * (1.0 - refused)
        result.append(math.log(quantile / (1.0 - quantile)))
    return np.array(result)


def waits(intersection: Map, traffic: Traffic, memory: Memory, i: int) -> bool:
    """Whether the vehicle stands at its line and does not go."""
    stands = traffic.speed[i] < STANDING and distance_to_stop_line(intersection, traffic, i) <= AT_LINE
    return bool(stands and not memory.delta[i])
