"""How probable each crossing order is: what the order network sees of a pair, and what all feasible orders share."""

import math
from collections.abc import Mapping

import numpy as np

from tests.reference.intersection import Conflict, Floats, Integers, Map
from tests.reference.networks import Network, evaluate
from tests.reference.observe import Feature, observe
from tests.reference.orders import complete, orders
from tests.reference.pairs import conflict_of, conflicts
from tests.reference.traffic import Traffic, distance_to_stop_line, front, rear

LATEST = 12.0  # s, of an arrival; also where there is nobody
LEAST_SPEED = 1.0  # m/s, of an arrival

Order = tuple[int, ...]


def order_features(intersection: Map, traffic: Traffic) -> Floats:
    """(pair, 21): eight of the yielder, eight of the prioritized vehicle, and five of the pair and the other foes."""
    pairs = [(int(i), int(j)) for i, j in conflicts(intersection, traffic)]
    driving = observe(intersection, traffic).driving
    rows = []
    for i, j in pairs:
        conflict = _conflict(intersection, traffic, i, j)
        of_yielder = _of_vehicle(intersection, traffic, driving, i, conflict.begin_yielder, conflict.end_yielder)
        of_foe = _of_vehicle(intersection, traffic, driving, j, conflict.begin_prioritized, conflict.end_prioritized)
        others = [_arrival(intersection, traffic, i, k) for yielder, k in pairs if yielder == i and k != j]
        of_foes = [_arrival(intersection, traffic, j, k) for yielder, k in pairs if yielder == j]
        of_pair = [conflict.merging, min([*others, LATEST]), len(others), min([*of_foes, LATEST]), len(of_foes)]
        rows.append([*of_yielder, *of_foe, *of_pair])
    return np.array(rows, dtype=np.float64).reshape(-1, 21)


def logits(intersection: Map, traffic: Traffic, network: Network) -> Floats:
    """(pair,), of the yielder going first."""
    return np.array([evaluate(network, row, "tanh") for row in order_features(intersection, traffic)])


def probabilities(
    intersection: Map, traffic: Traffic, logit: Floats, given: Integers | None = None
) -> dict[Order, float]:
    """Every feasible order that holds what is given, with its probability.

    Raises: ValueError if what is given contradicts lane order, itself, or what a vehicle can still do.
    """
    held = np.zeros(len(logit), np.int64) if given is None else complete(intersection, traffic, given)
    weights = {
        order: math.prod(_sigmoid(way * x) if way else 1.0 for way, x in zip(order, logit, strict=True))
        for order in orders(intersection, traffic)
        if all(sure in (0, way) for sure, way in zip(held, order, strict=True))
    }
    if not weights:
        return {tuple(held.tolist()): 1.0}
    return {order: weight / sum(weights.values()) for order, weight in weights.items()}


def yielder_first(probability: Mapping[Order, float], logit: Floats) -> Floats:
    """(pair,): how probable it is that the yielder goes first; by itself where an order leaves the pair open."""
    chance = np.zeros(len(logit))
    for order, share in probability.items():
        for pair, way in enumerate(order):
            chance[pair] += share * (_sigmoid(float(logit[pair])) if way == 0 else way > 0)
    return chance


def _sigmoid(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x))


def _conflict(intersection: Map, traffic: Traffic, i: int, j: int) -> Conflict:
    conflict = conflict_of(intersection, traffic, i, j)
    assert conflict is not None
    return conflict


def _of_vehicle(
    intersection: Map, traffic: Traffic, driving: Floats, vehicle: int, begin: float, end: float
) -> list[float]:
    return [
        begin - front(traffic, vehicle),
        end - rear(traffic, vehicle),
        distance_to_stop_line(intersection, traffic, vehicle),
        float(traffic.speed[vehicle]),
        *driving[vehicle, [Feature.V_MAX, Feature.D_LEAD, Feature.V_LEAD]].tolist(),
        float(traffic.length[vehicle]),
    ]


def _arrival(intersection: Map, traffic: Traffic, i: int, j: int) -> float:
    """When j, to whom i yields, reaches their conflict with the speed that it has, at most `LATEST` [s]."""
    way = _conflict(intersection, traffic, i, j).begin_prioritized - front(traffic, j)
    return min(way / max(float(traffic.speed[j]), LEAST_SPEED), LATEST)
