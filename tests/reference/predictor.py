"""Reference twin of the predictor: slow, obvious, float64, written from docs/model.md alone.

The one permitted copy of what the core knows, and its judge; nothing here comes from the package. Arrays follow the
axis order (time, vehicle, feature); metres, seconds, radians.
"""

import itertools
import math
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Gap = Literal["critical_gap", "sumo", "network"]
Driver = Literal["idm", "network", "constant_velocity"]

TIME_STEP = 0.2  # s
STEPS = 50
BRAKING = 4.0  # m/s², of s_brake
LEAD_RANGE = 100.0  # m
LEAD_SPEED = 100 / 3.6  # m/s, without a lead
BICYCLE_SPEED = 5.0  # m/s
NETWORK_ACCELERATION = 6.0  # m/s²
SAMPLE_FIELDS = ("x", "y", "heading", "width", "v_max", "h-10", "h-3", "h3", "h10", "h30", "h100")
X, Y, HEADING, WIDTH, V_MAX, HEADINGS = 0, 1, 2, 3, 4, slice(5, 11)
DELTA = 11  # the last of the driving features


@dataclass(frozen=True)
class Route:
    """A centreline by arc length [m]; samples: (sample, SAMPLE_FIELDS)."""

    id: str
    length: float
    stop_line: float
    stop_lane: int
    junction_begin: float
    junction_end: float
    first_conflict: float
    samples: Floats


@dataclass(frozen=True)
class Conflict:
    """Intervals [m] on the yielder's and on the prioritized route; their ends are the PGAs."""

    yielder: int
    prioritized: int
    merging: bool
    begin_yielder: float
    end_yielder: float
    begin_prioritized: float
    end_prioritized: float


@dataclass(frozen=True)
class SharedLane:
    """Routes a < b share a lane before `split`, and beyond their merges with position_b = position_a + offset [m]."""

    a: int
    b: int
    split: float
    merge_a: float
    merge_b: float
    offset: float


@dataclass(frozen=True)
class Overlap:
    """Where vehicles of two routes can touch [m]."""

    a: int
    b: int
    begin_a: float
    end_a: float
    begin_b: float
    end_b: float


@dataclass(frozen=True)
class Map:
    """A compiled map."""

    name: str
    spacing: float
    routes: tuple[Route, ...]
    conflicts: tuple[Conflict, ...]
    shared_lanes: tuple[SharedLane, ...]
    overlaps: tuple[Overlap, ...]


@dataclass(frozen=True)
class Traffic:
    """The vehicles at one moment; each array (vehicle,): route index, [m], [m/s], [m], [m], [m/s]."""

    route: Integers
    position: Floats
    speed: Floats
    length: Floats
    width: Floats
    max_speed: Floats


@dataclass(frozen=True)
class Network:
    """Fully connected layers (weight (output, input), bias (output,)) on inputs scaled by (x - shift) * scale."""

    shift: Floats
    scale: Floats
    layers: tuple[tuple[Floats, Floats], ...]


@dataclass(frozen=True)
class Observation:
    """driving: (vehicle, 12); gap: (pair, 4)."""

    driving: Floats
    gap: Floats


@dataclass(frozen=True)
class Memory:
    """What a vehicle remembers; each array (vehicle,)."""

    present: Booleans
    delta: Booleans
    hold: Integers


@dataclass(frozen=True)
class Prediction:
    """time (time,); position, speed, acceleration, enters, present (time, vehicle); time_loss (vehicle,) [s]."""

    time: Floats
    position: Floats
    speed: Floats
    acceleration: Floats
    enters: Booleans
    present: Booleans
    time_loss: Floats
    minimum_distance: float


# The compiled map


def load_map(path: str | Path) -> Map:
    """Reads a compiled map. Raises: ValueError on another magic, version, checksum or trailing lines."""
    data = Path(path).read_bytes()
    body, last = data[: data.rindex(b"checksum ")], data[data.rindex(b"checksum ") :].decode().split()
    if last != ["checksum", f"{zlib.crc32(body):08x}"]:
        raise ValueError(f"{path}: checksum {last[1:]}, but the bytes give {zlib.crc32(body):08x}")
    lines = iter([line.split() for line in body.decode().splitlines()])
    if next(lines) != ["intersection_env", "map", "1"]:
        raise ValueError(f"{path}: not an intersection_env map of version 1")
    (name,) = _field(lines, "name")
    _field(lines, "locations")
    (spacing,) = _field(lines, "spacing")
    _field(lines, "heading_offsets")
    result = Map(
        name,
        float(spacing),
        tuple(_route(lines) for _ in range(_count(lines, "routes"))),
        tuple(
            Conflict(int(row[0]), int(row[1]), row[2] == "1", *map(float, row[3:])) for row in _rows(lines, "conflicts")
        ),
        tuple(SharedLane(int(row[0]), int(row[1]), *map(float, row[2:])) for row in _rows(lines, "shared_lanes")),
        tuple(Overlap(int(row[0]), int(row[1]), *map(float, row[2:])) for row in _rows(lines, "overlaps")),
    )
    if (rest := list(lines)) != []:
        raise ValueError(f"{path}: {len(rest)} unexpected lines before the checksum")
    return result


def _field(lines: Iterator[list[str]], key: str) -> list[str]:
    """The tokens after `key` on the next line."""
    tokens = next(lines)
    if tokens[0] != key:
        raise ValueError(f"map: got {tokens[0]!r}, wanted {key!r}")
    return tokens[1:]


def _count(lines: Iterator[list[str]], key: str) -> int:
    return int(_field(lines, key)[0])


def _rows(lines: Iterator[list[str]], key: str) -> list[list[str]]:
    return [next(lines) for _ in range(_count(lines, key))]


def _route(lines: Iterator[list[str]]) -> Route:
    (identity,) = _field(lines, "route")
    length = float(_field(lines, "length")[0])
    stop_line = float(_field(lines, "stop_line")[0])
    stop_lane = int(_field(lines, "stop_lane")[0])
    begin, end = _field(lines, "junction")
    first_conflict = float(_field(lines, "first_conflict")[0])
    samples = np.array([[float(token) for token in row] for row in _rows(lines, "samples")])
    if samples.shape[1] != len(SAMPLE_FIELDS):
        raise ValueError(f"map: route {identity} has samples of {samples.shape[1]} values")
    return Route(identity, length, stop_line, stop_lane, float(begin), float(end), first_conflict, samples)


def sample(intersection: Map, route: int, position: float) -> Floats:
    """The sample fields at an arc length: interpolated linearly; beyond the ends the end value holds."""
    samples = intersection.routes[route].samples
    at = min(max(position / intersection.spacing, 0.0), len(samples) - 1.0)
    before = min(int(at), len(samples) - 2)
    fraction = at - before
    return np.asarray(samples[before] * (1 - fraction) + samples[before + 1] * fraction)


# Distances


def front(traffic: Traffic, i: int) -> float:
    return float(traffic.position[i] + traffic.length[i] / 2)


def rear(traffic: Traffic, i: int) -> float:
    return float(traffic.position[i] - traffic.length[i] / 2)


def distance_to_stop_line(intersection: Map, traffic: Traffic, i: int) -> float:
    return float(intersection.routes[traffic.route[i]].stop_line - front(traffic, i))


def braking_distance(traffic: Traffic, i: int) -> float:
    return float(max(traffic.speed[i], 0.0) ** 2 / (2 * BRAKING))


def speed_limit(intersection: Map, traffic: Traffic, i: int) -> float:
    """v_max: the map's at the vehicle's centre, or the vehicle's own."""
    here = sample(intersection, int(traffic.route[i]), float(traffic.position[i]))
    return float(min(here[V_MAX], traffic.max_speed[i]))


# Lead


def lead_gaps(intersection: Map, traffic: Traffic, i: int, j: int) -> list[float]:
    """The bumper-to-bumper gap under each of the rules by which j leads i; empty if it does not."""
    gaps = []
    bodies = (traffic.length[i] + traffic.length[j]) / 2
    s_i, s_j = traffic.position[i], traffic.position[j]
    if traffic.route[i] == traffic.route[j] and s_j > s_i:
        gaps.append(float(s_j - s_i - bodies))
    for lane in intersection.shared_lanes:
        if (traffic.route[i], traffic.route[j]) == (lane.a, lane.b):
            merge, there = lane.merge_b, s_j - lane.offset
        elif (traffic.route[i], traffic.route[j]) == (lane.b, lane.a):
            merge, there = lane.merge_a, s_j + lane.offset
        else:
            continue
        if rear(traffic, i) < lane.split and rear(traffic, j) < lane.split and s_j > s_i:
            gaps.append(float(s_j - s_i - bodies))
        if front(traffic, j) > merge and there > s_i:
            gaps.append(float(there - s_i - bodies))
    return gaps


def lead(intersection: Map, traffic: Traffic, present: Booleans, i: int) -> tuple[int | None, float, float]:
    """The lead's index, d_lead and v_lead of vehicle i."""
    best: int | None = None
    best_gap = math.inf
    for j in range(len(traffic.route)):
        if present[i] and present[j]:
            for gap in lead_gaps(intersection, traffic, i, j):
                if gap < best_gap:
                    best, best_gap = j, gap
    if best is None or best_gap > LEAD_RANGE:
        return None, LEAD_RANGE, LEAD_SPEED
    return best, best_gap, float(traffic.speed[best])


# Pairs


def conflict_of(intersection: Map, traffic: Traffic, i: int, j: int) -> Conflict | None:
    """The conflict in which i's route yields to j's."""
    for conflict in intersection.conflicts:
        if (conflict.yielder, conflict.prioritized) == (traffic.route[i], traffic.route[j]):
            return conflict
    return None


def conflicts(intersection: Map, traffic: Traffic) -> Integers:
    """(pair, 2): yielder i and prioritized j, sorted by i, then j."""
    pairs = []
    for i in range(len(traffic.route)):
        for j in range(len(traffic.route)):
            conflict = conflict_of(intersection, traffic, i, j)
            if conflict is None:
                continue
            if rear(traffic, i) < conflict.end_yielder and traffic.position[j] < conflict.end_prioritized:
                pairs.append((i, j))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def is_active(intersection: Map, traffic: Traffic, present: Booleans, pair: Integers, assignment: int) -> bool:
    i, j = int(pair[0]), int(pair[1])
    conflict = conflict_of(intersection, traffic, i, j)
    assert conflict is not None
    if not (present[i] and present[j]):
        return False
    if assignment == 1:
        return rear(traffic, j) < conflict.end_prioritized and bool(traffic.position[i] < conflict.end_yielder)
    return rear(traffic, i) < conflict.end_yielder and bool(traffic.position[j] < conflict.end_prioritized)


# Networks and features


def evaluate(network: Network, features: Floats, activation: Literal["leaky_relu", "tanh"]) -> float:
    """The network's one output; the activation follows every layer but the last."""
    x = (features - network.shift) * network.scale
    for number, (weight, bias) in enumerate(network.layers):
        x = weight @ x + bias
        if number < len(network.layers) - 1:
            x = np.tanh(x) if activation == "tanh" else np.where(x > 0, x, 0.01 * x)
    return float(x[0])


def initial_memory(intersection: Map, traffic: Traffic) -> Memory:
    count = len(traffic.route)
    present, delta = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    for i in range(count):
        route = intersection.routes[traffic.route[i]]
        present[i] = traffic.position[i] < route.length
        cannot_stop = distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i)
        delta[i] = cannot_stop and (traffic.speed[i] >= 1 or front(traffic, i) > route.first_conflict)
    return Memory(present, delta, np.full(count, -1, dtype=np.int64))


def observe(
    intersection: Map, traffic: Traffic, memory: Memory | None = None, pairs: Integers | None = None
) -> Observation:
    """What the networks see now; memory and pairs default to those of a start at this moment.

    driving: d_stop, v, v_max, headings at -10, -3, 3, 10, 30, 100 m, d_lead, v_lead, delta.
    gap: d_PGA of the yielder, its v, d_stop of the prioritized, its v.
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
        gap[number] = to_guarantee, traffic.speed[i], distance_to_stop_line(intersection, traffic, j), traffic.speed[j]
    return Observation(driving, gap)


# Decisions


def accepts_gap(
    intersection: Map, traffic: Traffic, pair: Integers, features: Floats, hold: Integers, gap: Gap, net: Network | None
) -> bool:
    """The gap decision of the pair's yielder; features: (4,)."""
    i, j = int(pair[0]), int(pair[1])
    conflict = conflict_of(intersection, traffic, i, j)
    assert conflict is not None
    if hold[j] > traffic.route[i]:
        return True
    to_guarantee, _, to_line, speed = (float(x) for x in features)
    if gap == "critical_gap":
        return to_line / max(speed, 1.0) > (4.0 if conflict.merging else 6.0)
    if gap == "sumo":
        limit_i, limit_j = speed_limit(intersection, traffic, i), speed_limit(intersection, traffic, j)
        foe_is_late = to_line / limit_j > to_guarantee / limit_i + 1.0
        foe_to_end = conflict.end_prioritized - rear(traffic, j)
        return foe_is_late or foe_to_end / limit_j < distance_to_stop_line(intersection, traffic, i) / limit_i
    assert net is not None, "gap='network' needs gap_network"
    return evaluate(net, features, "leaky_relu") > 0


@dataclass(frozen=True)
class Chooser:
    """How gaps are accepted, and what was assigned to each pair."""

    pairs: Integers
    assignments: Integers
    gap: Gap
    network: Network | None


@dataclass(frozen=True)
class Says:
    """What the active pairs say to each vehicle; (vehicle,)."""

    refused: Booleans
    """By the gap decision or an assignment."""
    told_to_wait: Booleans
    """By an assignment."""
    kept: Booleans
    """It waits, and lets one pass that yields to it but can no longer stop."""


def say(intersection: Map, traffic: Traffic, memory: Memory, chooser: Chooser, observation: Observation) -> Says:
    """What the pairs say before the step."""
    refused, told_to_wait, kept = (np.zeros(len(traffic.route), dtype=np.bool_) for _ in range(3))
    for number, pair in enumerate(chooser.pairs):
        assignment = int(chooser.assignments[number])
        if not is_active(intersection, traffic, memory.present, pair, assignment):
            continue
        if assignment == 0:
            if cannot_turn_back(intersection, traffic, memory, int(pair[0])) and not memory.delta[pair[1]]:
                kept[pair[1]] = True
            features = observation.gap[number]
            if not accepts_gap(intersection, traffic, pair, features, memory.hold, chooser.gap, chooser.network):
                refused[pair[0]] = True
        else:
            second = pair[1] if assignment == 1 else pair[0]
            refused[second] = True
            told_to_wait[second] = True
    return Says(refused, told_to_wait, kept)


def cannot_turn_back(intersection: Map, traffic: Traffic, memory: Memory, i: int) -> bool:
    """Whether the vehicle goes, by its memory, and could not stop at its line any more."""
    cannot_stop = distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i)
    return bool(memory.delta[i]) and cannot_stop


def decide(intersection: Map, traffic: Traffic, memory: Memory, says: Says) -> Booleans:
    """delta (vehicle,): what the pairs say, unless the vehicle goes and can no longer stop. Absent ones keep theirs."""
    delta = memory.delta.copy()
    for i in np.flatnonzero(memory.present).tolist():
        delta[i] = not (says.refused[i] or says.kept[i]) or cannot_turn_back(intersection, traffic, memory, i)
    return delta


def holds(intersection: Map, traffic: Traffic, memory: Memory, delta: Booleans, says: Says) -> Integers:
    """The new hold (vehicle,), from the new delta and the remembered holds. Absent ones keep theirs."""
    result = memory.hold.copy()
    for i in np.flatnonzero(memory.present).tolist():
        if delta[i] or not says.refused[i]:
            own = -1
        elif says.told_to_wait[i]:
            own = len(intersection.routes)
        else:
            own = int(traffic.route[i])
        queue = -1
        leader, _, _ = lead(intersection, traffic, memory.present, i)
        if leader is not None and distance_to_stop_line(intersection, traffic, i) >= 0:
            lanes = [intersection.routes[traffic.route[k]].stop_lane for k in (i, leader)]
            queue = int(memory.hold[leader]) if lanes[0] == lanes[1] else -1
        result[i] = max(own, queue)
    return result


# Driving


@dataclass(frozen=True)
class Idm:
    """Parameters; lateral: [m/s²], None where curves slow nobody."""

    standstill_gap: float = 1.5
    headway: float = 1.0
    acceleration: float = 2.5
    deceleration: float = 4.0
    hardest_braking: float = 8.0
    speed_share: float = 1.0
    lateral: float | None = None


PAPER_IDM = Idm()


def idm(speed: float, free_speed: float, gap: float, lead_speed: float, p: Idm = PAPER_IDM) -> float:
    """The acceleration [m/s²] behind one lead, not yet limited."""
    approach = speed * (speed - lead_speed) / (2 * math.sqrt(p.acceleration * p.deceleration))
    desired = p.standstill_gap + max(0.0, speed * p.headway + approach)
    return p.acceleration * (1 - (speed / free_speed) ** 4 - (desired / max(gap, 0.1)) ** 2)


def free_speeds(intersection: Map, route: int, p: Idm) -> Floats:
    """(sample,): how fast the IDM goes with nobody ahead, so slowly into curves that it can brake for them by b."""
    samples = intersection.routes[route].samples
    allowed = p.speed_share * samples[:, V_MAX]
    if p.lateral is None:
        return np.asarray(allowed)
    behind, ahead = (SAMPLE_FIELDS.index(name) for name in ("h-3", "h3"))
    curvature = np.maximum(np.abs(samples[:, ahead] - samples[:, behind]), 1e-4) / 6.0
    allowed = np.minimum(allowed, np.sqrt(p.lateral / curvature))
    along = np.arange(len(allowed)) * intersection.spacing
    return np.array(
        [np.sqrt(allowed[k:] ** 2 + 2 * p.deceleration * (along[k:] - along[k])).min() for k in range(len(allowed))]
    )


def free_speed(intersection: Map, traffic: Traffic, i: int, p: Idm) -> float:
    """The table's at the vehicle's centre, or the vehicle's own top speed."""
    table = free_speeds(intersection, int(traffic.route[i]), p)
    along = np.arange(len(table)) * intersection.spacing
    return float(min(np.interp(traffic.position[i], along, table), traffic.max_speed[i]))


def limited(features: Floats, wanted: float) -> float:
    """What a network may do: stay able to stop behind its lead, and before a line that it must not cross."""
    to_line, speed, lead_gap, lead_speed = (float(features[k]) for k in (0, 1, 9, 10))
    lead_next = max(0.0, lead_speed - TIME_STEP * NETWORK_ACCELERATION)
    lead_stops = TIME_STEP * (lead_speed + lead_next) / 2 + lead_next**2 / (2 * NETWORK_ACCELERATION)
    bounds = [(lead_gap + lead_stops - 0.5, NETWORK_ACCELERATION)]
    if features[DELTA] == 0 and to_line >= max(speed, 0.0) ** 2 / (2 * BRAKING) - 0.05:
        bounds.append((to_line - 0.02, BRAKING))
    allowed = wanted
    for distance, b in bounds:
        following = max(0.0, speed + TIME_STEP * wanted)
        if TIME_STEP * (speed + following) / 2 + following**2 / (2 * b) > distance:
            rest = distance - TIME_STEP * speed / 2
            following = b * (math.sqrt(max(0.0, TIME_STEP**2 / 4 + 2 * rest / b)) - TIME_STEP / 2)
            allowed = min(allowed, (following - speed) / TIME_STEP)
    return allowed if allowed == wanted else max(allowed, -NETWORK_ACCELERATION)


def drive(features: Floats, driver: Driver, network: Network | None, free: float, p: Idm = PAPER_IDM) -> float:
    """The acceleration [m/s²] of one vehicle; features: (12,); free: the IDM's speed with nobody ahead [m/s]."""
    if driver == "constant_velocity":
        return 0.0
    if driver == "network":
        assert network is not None, "driver='network' needs driver_network"
        return limited(features, NETWORK_ACCELERATION * math.tanh(evaluate(network, features, "tanh")))
    to_line, speed = float(features[0]), float(features[1])
    acceleration = idm(speed, free, float(features[9]), float(features[10]), p)
    if features[DELTA] == 0:
        acceleration = min(acceleration, idm(speed, free, to_line, 0.0, p))
    return min(max(acceleration, -p.hardest_braking), p.acceleration)


def advance(intersection: Map, traffic: Traffic, present: Booleans, wanted: Floats) -> tuple[Traffic, Booleans, Floats]:
    """The traffic and presence one step later, and the acceleration that was reached (vehicle,)."""
    position, speed, still = traffic.position.copy(), traffic.speed.copy(), present.copy()
    reached = np.zeros(len(position))
    for i in np.flatnonzero(present).tolist():
        before = speed[i]
        speed[i] = max(0.0, before + TIME_STEP * wanted[i])
        position[i] += TIME_STEP * (before + speed[i]) / 2
        reached[i] = (speed[i] - before) / TIME_STEP
        still[i] = position[i] < intersection.routes[traffic.route[i]].length
    return replace(traffic, position=position, speed=speed), still, reached


def predict(
    intersection: Map,
    traffic: Traffic,
    assignments: Integers | None = None,
    *,
    gap: Gap = "critical_gap",
    driver: Driver = "idm",
    gap_network: Network | None = None,
    driver_network: Network | None = None,
    idm_parameters: Idm = PAPER_IDM,
    delta: Booleans | None = None,
    steps: int = STEPS,
) -> Prediction:
    """Rolls one scenario out; assignments: (pair,); delta: (step, vehicle) decisions to replay.

    Raises: ValueError for assignments that contradict lane order, each other, or what a vehicle can still do.
    """
    pairs, memory = conflicts(intersection, traffic), initial_memory(intersection, traffic)
    given = np.zeros(len(pairs), dtype=np.int64) if assignments is None else assignments
    chooser = Chooser(pairs, complete(intersection, traffic, given), gap, gap_network)
    states, enters, reached = [traffic], [], []
    presences = [memory.present]
    for step in range(steps):
        observation = observe(intersection, traffic, memory, pairs)
        says = say(intersection, traffic, memory, chooser, observation)
        decided = decide(intersection, traffic, memory, says) if delta is None else delta[step].astype(np.bool_)
        hold = holds(intersection, traffic, memory, decided, says)
        observation.driving[:, DELTA] = decided
        wanted = np.array(
            [
                drive(
                    features,
                    driver,
                    driver_network,
                    free_speed(intersection, traffic, i, idm_parameters) if driver == "idm" else 0.0,
                    idm_parameters,
                )
                for i, features in enumerate(observation.driving)
            ]
        )
        traffic, present, acceleration = advance(intersection, traffic, memory.present, wanted)
        memory = Memory(present, decided, hold)
        states.append(traffic)
        presences.append(present)
        enters.append(decided)
        reached.append(acceleration)
    return Prediction(
        time=np.array([TIME_STEP * step for step in range(steps + 1)]),
        position=np.array([state.position for state in states]),
        speed=np.array([state.speed for state in states]),
        acceleration=np.array([*reached, reached[-1]]),
        enters=np.array([*enters, enters[-1]]),
        present=np.array(presences),
        time_loss=time_loss(intersection, states[:-1], presences[:-1]),
        minimum_distance=min(minimum_distance(intersection, *moment) for moment in zip(states, presences, strict=True)),
    )


# Outputs


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


def body_distance(intersection: Map, traffic: Traffic, i: int, j: int) -> float:
    """The smallest distance [m] between the borders of two bodies, each two circles of radius W/2 at ±L/4.

    Beyond its last sample a route goes straight on.
    """
    centres = []
    for k in (i, j):
        route, position = int(traffic.route[k]), float(traffic.position[k])
        here = sample(intersection, route, position)
        forward = np.array([math.cos(here[HEADING]), math.sin(here[HEADING])])
        beyond = max(0.0, position - intersection.spacing * (len(intersection.routes[route].samples) - 1))
        centre = here[[X, Y]] + beyond * forward
        centres.append([centre + side * traffic.length[k] / 4 * forward for side in (-1, 1)])
    apart = min(float(np.hypot(*(p - q))) for p in centres[0] for q in centres[1])
    return apart - float(traffic.width[i] + traffic.width[j]) / 2


def minimum_distance(intersection: Map, traffic: Traffic, present: Booleans) -> float:
    """Over all pairs of present vehicles that can touch; infinite without any."""
    return min(
        (
            body_distance(intersection, traffic, i, j)
            for i, j in itertools.combinations(np.flatnonzero(present).tolist(), 2)
            if can_touch(intersection, traffic, i, j)
        ),
        default=math.inf,
    )


# Crossing orders


def lane_chains(intersection: Map, traffic: Traffic) -> list[list[int]]:
    """The queues at the stop lines, one list a stop lane, front vehicle first."""
    committed = initial_memory(intersection, traffic).delta
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


def orders(intersection: Map, traffic: Traffic, cooperative: Collection[int] | None = None) -> set[tuple[int, ...]]:
    """Every crossing order, as assignments (pair,) over `conflicts`, by trying all orientations."""
    pairs = [(int(i), int(j)) for i, j in conflicts(intersection, traffic)]
    committed = initial_memory(intersection, traffic).delta  # at the start, delta = 1 only if it can no longer stop
    forced = {}
    for number, (i, j) in enumerate(pairs):
        is_chosen = cooperative is None or (i in cooperative and j in cooperative)
        if not is_chosen or (committed[i] and committed[j]):
            forced[number] = 0
        elif committed[i] or committed[j]:
            forced[number] = 1 if committed[i] else -1
    return acyclic_orientations(pairs, lane_chains(intersection, traffic), forced)


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


def complete(intersection: Map, traffic: Traffic, assignments: Integers) -> Integers:
    """Assignments (pair,) completed under lane order and transitively.

    Raises: ValueError if they contradict lane order, each other, or what a vehicle can still do.
    """
    pairs = [(int(i), int(j)) for i, j in conflicts(intersection, traffic)]
    if assignments.shape != (len(pairs),) or not np.isin(assignments, (-1, 0, 1)).all():
        raise ValueError(f"assignments: got {assignments}, wanted -1, 0 or 1 for each of {len(pairs)} pairs")
    closed = closure(pairs, lane_chains(intersection, traffic), assignments.tolist())
    committed = initial_memory(intersection, traffic).delta
    is_fixed = [bool(committed[i] and committed[j]) for i, j in pairs]
    signs = [int(given) if fixed else sign for given, sign, fixed in zip(assignments, closed, is_fixed, strict=True)]
    for before, after in oriented(pairs, signs):
        if committed[after]:
            raise ValueError(f"assignments: {after} can no longer stop for {before}")
    return np.array(signs, dtype=np.int64)


# Random traffic


def random_traffic(intersection: Map, generator: np.random.Generator, vehicles: int) -> Traffic:
    """Plausible traffic: mostly near the junction, no bodies closer than 0.3 m, no gaps in a lane below 1 m.

    Every value is exact in float32, so that twin and core start from the same traffic.
    """
    sizes = ((4.5, 1.8, math.inf), (4.1, 1.75, math.inf), (12.0, 2.5, math.inf), (1.8, 0.6, BICYCLE_SPEED))
    traffic = Traffic(np.zeros(0, np.int64), *(np.zeros(0) for _ in range(5)))
    for _ in range(1000 * vehicles + 1):
        if len(traffic.route) == vehicles:
            return traffic
        route = int(generator.integers(len(intersection.routes)))
        road = intersection.routes[route]
        length, width, max_speed = sizes[generator.choice(4, p=(0.4, 0.35, 0.1, 0.15))]
        near = (road.stop_line - 45, road.stop_line), (road.stop_line, road.junction_end + 15), (0.0, road.stop_line)
        position = float(np.float32(generator.uniform(*near[generator.choice(3, p=(0.7, 0.2, 0.1))])))
        limit = min(float(sample(intersection, route, position)[V_MAX]), max_speed)
        speed = 0.0 if generator.random() < 0.15 else float(generator.uniform(0, 1.1)) * limit
        fields = (route, position, *(float(np.float32(x)) for x in (speed, length, width, max_speed)))
        names = ("route", "position", "speed", "length", "width", "max_speed")
        tried = replace(
            traffic, **{n: np.append(getattr(traffic, n), np.asarray(x)) for n, x in zip(names, fields, strict=True)}
        )
        if _is_free(intersection, tried):
            traffic = tried
    raise ValueError(f"random_traffic: no room for {vehicles} vehicles on {intersection.name}")


def _is_free(intersection: Map, traffic: Traffic) -> bool:
    """Whether the last vehicle keeps its distance from all others."""
    last = len(traffic.route) - 1
    for other in range(last):
        gaps = lead_gaps(intersection, traffic, last, other) + lead_gaps(intersection, traffic, other, last)
        if min(gaps, default=math.inf) < 1.0:
            return False
        if can_touch(intersection, traffic, last, other) and body_distance(intersection, traffic, last, other) < 0.3:
            return False
    return True
