"""Reference twin of the worlds: the closed loop and the replay, from "The worlds" in docs/model.md alone.

Slow, obvious, float64, like `tests.reference.predictor`, whose functions say what is seen, who leads and who enters.
One world at a time; arrays follow the axis order (time, vehicle, feature).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tests.reference.predictor import (
    BRAKING,
    DELTA,
    NETWORK_ACCELERATION,
    TIME_STEP,
    Booleans,
    Chooser,
    Floats,
    Gap,
    Integers,
    Map,
    Memory,
    Network,
    Observation,
    Says,
    Traffic,
    accepts_gap,
    body_distance,
    braking_distance,
    can_touch,
    conflict_of,
    decide,
    holds,
    initial_memory,
    is_active,
    lead,
    lead_gaps,
    observe,
    rear,
    say,
    speed_limit,
)

D_STOP, SPEED, V_MAX, D_LEAD = 0, 1, 2, 9  # places in the driving features
COMFORTABLE, HARD = 2.5, 4.0  # m/s², |a| above these is penalized
COLLISION = 5000.0
SAFETY_DISTANCE = 0.5  # m, between the borders of two vehicles' circles
SLOWEST, FASTEST = 1.0, 4.0  # m/s², of v_lo and v_hi: v = sqrt(2 a d)
VIOLATED = 1e-3  # a penalty above this violates a constraint


@dataclass(frozen=True)
class Rules:
    """Whose gap decisions count."""

    gap: Gap = "critical_gap"
    network: Network | None = None


@dataclass(frozen=True)
class State:
    """A world after its decisions; delta, hold: (vehicle,)."""

    traffic: Traffic
    delta: Booleans
    hold: Integers


@dataclass(frozen=True)
class Step:
    """What follows from one step; rows of final_observation count where a flag is set. All (vehicle, ...)."""

    state: State
    observation: Floats
    final_observation: Floats
    reward: Floats
    terminated: Booleans
    truncated: Booleans
    reinserted: Booleans
    done: bool


# Reward: paper, Table II


@dataclass(frozen=True)
class Penalties:
    """The parts of one vehicle's reward that depend on where it is and how fast, as positive numbers."""

    slow: float
    fast: float
    backwards: float
    lead: float
    line: float

    def violate(self, *, slow_counts: bool) -> bool:
        values = [self.fast, self.backwards, self.lead, self.line, *([self.slow] if slow_counts else [])]
        return max(values) > VIOLATED


def least_speed(features: Floats) -> float:
    """v_min of one vehicle; features: (12,)."""
    must_stop = features[DELTA] == 0
    distance = min(features[D_LEAD], features[D_STOP]) if must_stop else features[D_LEAD]
    return min(float(features[V_MAX]), math.sqrt(2 * SLOWEST * max(0.0, float(distance))))


def penalties(features: Floats) -> Penalties:
    """features: (12,) of one vehicle, delta as decided."""
    to_line, speed, limit, gap = (float(features[k]) for k in (D_STOP, SPEED, V_MAX, D_LEAD))
    braking = max(speed, 0.0) ** 2 / (2 * BRAKING)
    return Penalties(
        slow=20 / limit * max(0.0, least_speed(features) - speed),
        fast=30 / limit * max(0.0, speed - limit),
        backwards=30 * max(0.0, -speed),
        lead=30 * max(0.0, braking - gap),
        line=30 * max(0.0, braking - to_line) if features[DELTA] == 0 else 0.0,
    )


def reward(features: Floats, acceleration: float, is_to_blame: bool) -> float:
    """One vehicle's reward; features: (12,); acceleration [m/s²] of the step that led there."""
    result = 2 - 0.01 * acceleration**2
    result -= 1 if abs(acceleration) > COMFORTABLE else 0
    result -= 20 if abs(acceleration) > HARD else 0
    parts = penalties(features)
    result -= parts.slow + parts.fast + parts.backwards + parts.lead + parts.line
    return result - (COLLISION if is_to_blame else 0.0)


# Collisions


def braked(traffic: Traffic) -> Traffic:
    """Everybody where full braking would end."""
    ahead = np.array([braking_distance(traffic, i) for i in range(len(traffic.route))])
    return replace(traffic, position=traffic.position + ahead)


def collide(intersection: Map, traffic: Traffic, i: int, j: int) -> bool:
    """Whether two vehicles collide, now or after braking."""
    return any(
        can_touch(intersection, moment, i, j) and body_distance(intersection, moment, i, j) < SAFETY_DISTANCE
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


# The closed loop


def all_pairs(intersection: Map, traffic: Traffic) -> Integers:
    """(pair, 2): every yielder i and prioritized j by their routes."""
    slots = range(len(traffic.route))
    found = [(i, j) for i in slots for j in slots if conflict_of(intersection, traffic, i, j) is not None]
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def decided(
    intersection: Map, traffic: Traffic, delta: Booleans, hold: Integers, rules: Rules
) -> tuple[State, Observation]:
    """The traffic with its decisions, from the remembered delta and hold; and what is seen."""
    pairs = all_pairs(intersection, traffic)
    memory = Memory(np.ones(len(traffic.route), np.bool_), delta, hold)
    chooser = Chooser(pairs, np.zeros(len(pairs), np.int64), rules.gap, rules.network)
    seen = observe(intersection, traffic, memory, pairs)
    says = say(intersection, traffic, memory, chooser, seen)
    enters = decide(intersection, traffic, memory, says)
    seen.driving[:, DELTA] = enters
    return State(traffic, enters, holds(intersection, traffic, memory, enters, says)), seen


def moved(intersection: Map, traffic: Traffic, acceleration: Floats) -> tuple[Traffic, Booleans]:
    """The traffic one step later, nobody reinserted; and who has left (vehicle,)."""
    speed = traffic.speed + TIME_STEP * acceleration
    position = traffic.position + TIME_STEP * (traffic.speed + speed) / 2
    length = np.array([intersection.routes[r].length for r in traffic.route])
    return replace(traffic, position=position, speed=speed), (position >= length) | (position < 0)


def seated(traffic: Traffic, left: Booleans, newcomers: Traffic) -> Traffic:
    """The traffic, with the rows of those that left taken from the newcomers."""
    names = ("route", "position", "speed", "length", "width", "max_speed")
    return Traffic(*(np.where(left, getattr(newcomers, name), getattr(traffic, name)) for name in names))


def alone(intersection: Map, traffic: Traffic, i: int) -> Floats:
    """(12,): what vehicle i sees with nobody else there, entering."""
    names = ("route", "position", "speed", "length", "width", "max_speed")
    only = Traffic(*(getattr(traffic, name)[[i]] for name in names))
    there = Memory(np.ones(1, np.bool_), np.ones(1, np.bool_), np.array([-1]))
    return np.asarray(observe(intersection, only, there, np.zeros((0, 2), np.int64)).driving[0])


def step(
    intersection: Map,
    state: State,
    action: Floats,
    rules: Rules,
    newcomers: Traffic | None = None,
    is_last_cycle: bool = False,
) -> Step:
    """One step of the closed loop; action: (vehicle,) in [-1, 1].

    newcomers: whose rows take the places of vehicles that leave; needed only where one does.
    """
    acceleration = NETWORK_ACCELERATION * action
    traffic, left = moved(intersection, state.traffic, acceleration)
    final = {i: alone(intersection, traffic, i) for i in np.flatnonzero(left).tolist()}
    if left.any():
        assert newcomers is not None, f"vehicles {np.flatnonzero(left)} leave"
        traffic = seated(traffic, left, newcomers)
    new, seen = decided(intersection, traffic, state.delta & ~left, np.where(left, -1, state.hold), rules)
    involved, blamed = collisions(intersection, traffic, left)
    final_observation = seen.driving.copy()
    for i, features in final.items():
        final_observation[i] = features
    worth = [reward(final_observation[i], float(acceleration[i]), bool(blamed[i])) for i in range(len(left))]
    comes_badly = any(penalties(seen.driving[i]).violate(slow_counts=False) for i in final)
    done = bool(involved.any()) or comes_badly or is_last_cycle
    return Step(
        state=new,
        observation=seen.driving,
        final_observation=final_observation,
        reward=np.array(worth),
        terminated=blamed,
        truncated=~blamed & done,
        reinserted=left & (not done),
        done=done,
    )


# Starts and newcomers


def speed_range(intersection: Map, traffic: Traffic, i: int, distance: float) -> tuple[float, float]:
    """v_lo and v_hi of vehicle i, this far from what it must not reach [m/s]."""
    limit = speed_limit(intersection, traffic, i)
    free = max(0.0, distance)
    return min(limit, math.sqrt(2 * SLOWEST * free)), min(limit, math.sqrt(2 * FASTEST * free))


def newcomer_distance(intersection: Map, traffic: Traffic, left: Booleans, i: int) -> float:
    """d_lead of newcomer i, among who has not left and the newcomers before it; traffic: everybody seated."""
    there = ~left | (np.arange(len(left)) <= i)
    return max(0.0, lead(intersection, traffic, there, i)[1])


def violations(intersection: Map, state: State) -> list[str]:
    """The constraints of a start that a state violates, in words."""
    there = Memory(np.ones(len(state.delta), np.bool_), state.delta, state.hold)
    seen = observe(intersection, state.traffic, there, np.zeros((0, 2), np.int64)).driving
    found = []
    for i, features in enumerate(seen):
        if penalties(features).violate(slow_counts=True):
            found.append(f"vehicle {i}: {penalties(features)}")
    involved, _ = collisions(intersection, state.traffic, np.zeros(len(state.delta), np.bool_))
    return [*found, *(f"vehicle {i} collides" for i in np.flatnonzero(involved))]


# Recorded scenes


@dataclass(frozen=True)
class Track:
    """One recorded vehicle, from step `start` of its scene; position, speed, observed: (time,).

    Not observed: extrapolated into the past.
    """

    route: int
    length: float
    width: float
    max_speed: float
    start: int
    position: Floats
    speed: Floats
    observed: Booleans

    @property
    def stop(self) -> int:
        """The first step at which it is no longer there."""
        return self.start + len(self.position)

    def acceleration(self, time: int) -> float:
        """What takes it on from that step of its scene to the next; at the last one, what brought it there."""
        k = min(time - self.start, len(self.speed) - 2)
        return float(self.speed[k + 1] - self.speed[k]) / TIME_STEP

    @property
    def first_recorded(self) -> int:
        """The step at which it may begin to act."""
        return self.start + int(np.flatnonzero(self.observed)[0])


@dataclass(frozen=True)
class Scene:
    """Recorded tracks, and for how many steps."""

    steps: int
    tracks: tuple[Track, ...]


@dataclass(frozen=True)
class Recording:
    """A scene on its map, and whose gap decisions count: the recorded ones where `rules` is None."""

    intersection: Map
    scene: Scene
    rules: Rules | None


def tracks_at(scene: Scene, time: int) -> list[int]:
    """Who is there at a step."""
    return [k for k, track in enumerate(scene.tracks) if track.start <= time < track.stop]


def recorded_traffic(scene: Scene, time: int, here: list[int]) -> Traffic:
    """Some tracks as they were recorded at a step."""
    tracks = [scene.tracks[k] for k in here]
    return Traffic(
        np.array([track.route for track in tracks], dtype=np.int64),
        *(np.array([getattr(track, name)[time - track.start] for track in tracks]) for name in ("position", "speed")),
        *(np.array([getattr(track, name) for track in tracks]) for name in ("length", "width", "max_speed")),
    )


def reaches(track: Track, line: float) -> float:
    """When the front reaches an arc length, in steps of the scene, linearly between them; infinite if it never does."""
    fronts = track.position + track.length / 2
    reached = np.flatnonzero(fronts >= line)
    if not len(reached):
        return math.inf
    k = int(reached[0])
    return track.start + k - (float((fronts[k] - line) / (fronts[k] - fronts[k - 1])) if k else 0.0)


def yielder_was_first(recording: Recording, i: int, j: int) -> bool:
    """Whether track i, which yields to j, reached their conflict before j did."""
    mine, other = recording.scene.tracks[i], recording.scene.tracks[j]
    for conflict in recording.intersection.conflicts:
        if (conflict.yielder, conflict.prioritized) == (mine.route, other.route):
            return reaches(mine, conflict.begin_yielder) < reaches(other, conflict.begin_prioritized)
    raise ValueError(f"track {i} does not yield to {j}")


def was_behind(recording: Recording, j: int, i: int) -> bool:
    """Whether track j was recorded behind i where they share a lane."""
    mine, other = recording.scene.tracks[i], recording.scene.tracks[j]
    shares_entry = mine.route == other.route
    for lane in recording.intersection.shared_lanes:
        if (mine.route, other.route) == (lane.a, lane.b):
            merge, merge_other = lane.merge_a, lane.merge_b
        elif (mine.route, other.route) == (lane.b, lane.a):
            merge, merge_other = lane.merge_b, lane.merge_a
        else:
            continue
        shares_entry = shares_entry or lane.split > 0
        if reaches(other, merge_other) > reaches(mine, merge):
            return True
    both = max(mine.start, other.start)
    if not shares_entry or both >= min(mine.stop, other.stop):
        return False
    return bool(other.position[both - other.start] < mine.position[both - mine.start])


def recorded_holds(recording: Recording, time: int, here: list[int]) -> Integers:
    """hold of some tracks: a vehicle is held as long as it waits, by the recorded order, for another that is there."""
    traffic = recorded_traffic(recording.scene, time, here)
    result = np.full(len(here), -1, np.int64)
    for i, j in all_pairs(recording.intersection, traffic):
        is_open = is_active(recording.intersection, traffic, np.ones(len(here), np.bool_), np.array([i, j]), 0)
        if is_open and not yielder_was_first(recording, here[i], here[j]):
            result[i] = traffic.route[i]
    return result


# The replay


@dataclass(frozen=True)
class Ride:
    """The acting vehicle at a step of its scene, and what it and its recorded self have decided there."""

    track: int
    time: int
    position: float
    speed: float
    delta: bool
    expert_delta: bool


@dataclass(frozen=True)
class View:
    """What the acting vehicle and its recorded self see: (12,) each."""

    observation: Floats
    expert_observation: Floats


@dataclass(frozen=True)
class RideStep:
    """What follows from one step of the replay."""

    ride: Ride
    view: View
    reward: float
    terminated: bool
    truncated: bool


def traffic_around(
    recording: Recording, time: int, actor: int, position: float, speed: float
) -> tuple[Traffic, list[int], int]:
    """Everybody at a step, the actor there and that fast; who they are; and the actor's place among them."""
    here = tracks_at(recording.scene, time)
    traffic, me = recorded_traffic(recording.scene, time, here), here.index(actor)
    traffic.position[me], traffic.speed[me] = position, speed
    return traffic, here, me


def actor_decides(
    recording: Recording, time: int, actor: int, position: float, speed: float, remembered: bool | None
) -> tuple[bool, Floats]:
    """The actor's delta and features (12,) from its remembered delta; None: its first step."""
    intersection, rules = recording.intersection, recording.rules
    traffic, here, me = traffic_around(recording, time, actor, position, speed)
    if remembered is None:
        remembered = bool(initial_memory(intersection, traffic).delta[me])
    hold = recorded_holds(recording, time, here)
    pairs = np.array([pair for pair in all_pairs(intersection, traffic) if pair[0] == me], np.int64).reshape(-1, 2)
    delta = np.full(len(here), remembered)
    may_lead = np.array([not was_behind(recording, k, actor) for k in here])
    seen = observe(intersection, traffic, Memory(may_lead, delta, hold), pairs)
    refused = np.zeros(len(here), np.bool_)
    for pair, features in zip(pairs, seen.gap, strict=True):
        if not is_active(intersection, traffic, np.ones(len(here), np.bool_), pair, 0):
            continue
        if rules is None:
            refused[me] |= not yielder_was_first(recording, actor, here[pair[1]])
        else:
            refused[me] |= not accepts_gap(intersection, traffic, pair, features, hold, rules.gap, rules.network)
    nobody = np.zeros(len(here), np.bool_)
    memory = Memory(~nobody, delta, hold)
    seen.driving[me, DELTA] = decide(intersection, traffic, memory, Says(refused, nobody, nobody))[me]
    return bool(seen.driving[me, DELTA]), np.asarray(seen.driving[me])


def begin(recording: Recording, actor: int) -> tuple[Ride, View]:
    """The actor's episode at its first recorded step."""
    track = recording.scene.tracks[actor]
    time = track.first_recorded
    position, speed = float(track.position[time - track.start]), float(track.speed[time - track.start])
    delta, features = actor_decides(recording, time, actor, position, speed, None)
    return Ride(actor, time, position, speed, delta, delta), View(features, features)


def is_actors_fault(recording: Recording, traffic: Traffic, here: list[int], me: int, other: int) -> bool:
    """Whether a collision of the actor with another vehicle is the actor's fault: right of way, then lane order."""
    for yielder, prioritized in ((me, other), (other, me)):
        conflict = conflict_of(recording.intersection, traffic, yielder, prioritized)
        if conflict is None:
            continue
        if recording.rules is None:
            yielder_is_second = not yielder_was_first(recording, here[yielder], here[prioritized])
            return (yielder if yielder_is_second else prioritized) == me
        if rear(traffic, yielder) < conflict.end_yielder:
            return yielder == me
    return was_behind(recording, here[me], here[other])


def ride_on(recording: Recording, ride: Ride, action: float) -> RideStep:
    """One step of the replay; action in [-1, 1]."""
    intersection, actor = recording.intersection, ride.track
    track = recording.scene.tracks[actor]
    speed = max(0.0, ride.speed + TIME_STEP * NETWORK_ACCELERATION * action)
    position = ride.position + TIME_STEP * (ride.speed + speed) / 2
    acceleration = (speed - ride.speed) / TIME_STEP  # as reached, which the reward is about
    time = ride.time + 1
    at, fast = float(track.position[time - track.start]), float(track.speed[time - track.start])
    expert_delta, expert_sees = actor_decides(recording, time, actor, at, fast, ride.expert_delta)
    traffic, here, me = traffic_around(recording, time, actor, position, speed)
    if position >= intersection.routes[track.route].length:
        features = alone(intersection, traffic, me)
        ride = Ride(actor, time, position, speed, True, expert_delta)
        return RideStep(ride, View(features, expert_sees), reward(features, acceleration, False), False, True)
    delta, features = actor_decides(recording, time, actor, position, speed, ride.delta)
    fault = any(
        collide(intersection, traffic, me, other) and is_actors_fault(recording, traffic, here, me, other)
        for other in range(len(here))
        if other != me
    )
    return RideStep(
        ride=Ride(actor, time, position, speed, delta, expert_delta),
        view=View(features, expert_sees),
        reward=reward(features, acceleration, fault),
        terminated=fault,
        truncated=not fault and time == track.stop - 1,
    )
