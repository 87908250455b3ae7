"""Gap decision, decision and hold: who enters, and whom a waiting vehicle holds."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tests.reference.intersection import Booleans, Floats, Integers, Map
from tests.reference.lead import lead
from tests.reference.memory import Memory, is_beyond, is_settled
from tests.reference.networks import Network, evaluate
from tests.reference.observe import Observation
from tests.reference.pairs import conflict_of, is_active
from tests.reference.stops import by_arrival, still_to_stop
from tests.reference.traffic import Traffic, distance_to_stop_line, rear, speed_limit

Gap = Literal["critical_gap", "sumo", "network"]


@dataclass(frozen=True)
class Rules:
    """Whose gap decisions count."""

    gap: Gap = "critical_gap"
    network: Network | None = None
    patience: Floats | None = None
    """(vehicle,) the logit that the network's must exceed; None: 0."""


@dataclass(frozen=True)
class Chooser:
    """How gaps are accepted, and what was assigned to each pair."""

    pairs: Integers
    assignments: Integers
    rules: Rules


@dataclass(frozen=True)
class Says:
    """What the active pairs say to each vehicle; (vehicle,)."""

    refused: Booleans
    """By the gap decision, an assignment or the order of arrival; or it has yet to make its stop."""
    told_to_wait: Booleans
    """By an assignment."""
    kept: Booleans
    """It waits, and lets one pass that yields to it but can no longer stop."""


# Gap decision


def accepts_gap(
    intersection: Map, traffic: Traffic, pair: Integers, features: Floats, hold: Integers, rules: Rules
) -> bool:
    """The gap decision of the pair's yielder; features: (4,)."""
    gap, net = rules.gap, rules.network
    i, j = int(pair[0]), int(pair[1])
    conflict = conflict_of(intersection, traffic, i, j)
    assert conflict is not None
    if hold[j] > intersection.ranks[traffic.route[i]]:
        return True
    to_guarantee, _, to_line, speed = (float(x) for x in features)
    if gap == "critical_gap":
        return to_line / max(speed, 1.0) > (4.0 if conflict.merging else 6.0)
    if gap == "sumo":
        limit_i, limit_j = speed_limit(intersection, traffic, i), speed_limit(intersection, traffic, j)
        foe_is_late = to_line / limit_j > to_guarantee / limit_i + 1.0
        foe_to_end = conflict.end_prioritized - rear(traffic, j)
        return foe_is_late or foe_to_end / limit_j < distance_to_stop_line(intersection, traffic, i) / limit_i
    assert net is not None, "gap='network' needs a network"
    return evaluate(net, features, "leaky_relu") > (0 if rules.patience is None else rules.patience[i])


# Decision


def say(intersection: Map, traffic: Traffic, memory: Memory, chooser: Chooser, observation: Observation) -> Says:
    """What the pairs say before the step."""
    refused = still_to_stop(intersection, traffic, memory)
    told_to_wait, kept = (np.zeros(len(traffic.route), dtype=np.bool_) for _ in range(2))
    rules = chooser.rules
    for number, pair in enumerate(chooser.pairs):
        assignment = int(chooser.assignments[number])
        way = assignment
        conflict = conflict_of(intersection, traffic, int(pair[0]), int(pair[1]))
        assert conflict is not None
        if assignment == 0 and conflict.by_arrival:
            way = by_arrival(intersection, traffic, memory, int(pair[0]), int(pair[1]))
        if not is_active(intersection, traffic, memory.present, pair, way):
            continue
        if way == 0:
            if is_settled(intersection, traffic, memory, int(pair[0])) and not memory.delta[pair[1]]:
                kept[pair[1]] = True
            features = observation.gap[number]
            if not accepts_gap(intersection, traffic, pair, features, memory.hold, rules):
                refused[pair[0]] = True
        else:
            second = pair[1] if way == 1 else pair[0]
            refused[second] = True
            told_to_wait[second] |= assignment != 0
    return Says(refused, told_to_wait, kept)


def decide(intersection: Map, traffic: Traffic, memory: Memory, says: Says) -> Booleans:
    """delta (vehicle,): what the pairs say, unless the vehicle is settled. Absent ones keep theirs."""
    delta = memory.delta.copy()
    for i in np.flatnonzero(memory.present).tolist():
        delta[i] = not (says.refused[i] or says.kept[i]) or is_settled(intersection, traffic, memory, i)
    return delta


# Hold


def holds(intersection: Map, traffic: Traffic, memory: Memory, delta: Booleans, says: Says) -> Integers:
    """The new hold (vehicle,), from the new delta and the remembered holds. Absent ones keep theirs."""
    result = memory.hold.copy()
    for i in np.flatnonzero(memory.present).tolist():
        if delta[i] or not says.refused[i]:
            own = -1
        elif says.told_to_wait[i]:
            own = len(intersection.routes)
        else:
            own = intersection.ranks[traffic.route[i]]
        queue = -1
        leader, _, _ = lead(intersection, traffic, memory.present, i)
        is_before = distance_to_stop_line(intersection, traffic, i) >= 0
        if leader is not None and (is_before or not is_beyond(intersection, traffic, i)):
            lanes = [intersection.routes[traffic.route[k]].stop_lane for k in (i, leader)]
            queue = int(memory.hold[leader]) if lanes[0] == lanes[1] else -1
        result[i] = max(own, queue)
    return result
