"""Replay: one vehicle of a recorded scene acts, all others are where they were recorded."""

from dataclasses import dataclass

import numpy as np

from tests.reference.collisions import collide, yielder_before_pga
from tests.reference.decide import Says, accepts_gap, decide
from tests.reference.drive import NETWORK_ACCELERATION
from tests.reference.intersection import Floats, Integers
from tests.reference.memory import Memory, cannot_stop, initial_memory
from tests.reference.observe import Feature, alone, observe
from tests.reference.pairs import all_pairs, conflict_of, is_active
from tests.reference.recorded import (
    Recording,
    has_waited,
    recorded_holds,
    recorded_traffic,
    stop_is_asked,
    tracks_at,
    was_behind,
    went_second,
    yielder_was_first,
)
from tests.reference.reward import reward
from tests.reference.stops import by_arrival, still_to_stop, with_stops
from tests.reference.traffic import TIME_STEP, Traffic


@dataclass(frozen=True)
class Ride:
    """The acting vehicle at a step of its scene, and what it and its recorded self have decided there."""

    track: int
    time: int
    position: float
    speed: float
    delta: bool
    expert_delta: bool
    waited: int = 0


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


@dataclass(frozen=True)
class Decided:
    """What the actor has decided, what it sees (12,), and for how long it has waited."""

    delta: bool
    features: Floats
    waited: int


def actor_decides(
    recording: Recording, time: int, actor: int, position: float, speed: float, remembered: bool | None, waited: int
) -> Decided:
    """The actor's decision from its remembered delta and what it has waited before; None: its first step."""
    intersection, rules = recording.intersection, recording.rules
    traffic, here, me = traffic_around(recording, time, actor, position, speed)
    if remembered is None:
        remembered = bool(initial_memory(intersection, traffic).delta[me])
    hold = recorded_holds(recording, time, here)
    pairs = np.array([pair for pair in all_pairs(intersection, traffic) if pair[0] == me], np.int64).reshape(-1, 2)
    delta = np.full(len(here), remembered)
    may_lead = np.array([not was_behind(recording, k, actor) for k in here])
    seen = observe(intersection, traffic, Memory(may_lead, delta, hold), pairs)
    memory = _memories(recording, time, (traffic, here, me), (remembered, waited), hold)
    refused = np.zeros(len(here), np.bool_)
    if stop_is_asked(recording, actor):
        refused[me] = still_to_stop(intersection, traffic, memory)[me]
    for pair, features in zip(pairs, seen.gap, strict=True):
        if is_active(intersection, traffic, memory.present, pair, 0) and not _by_arrival(recording, traffic, pair):
            if rules is None:
                refused[me] |= not yielder_was_first(recording, actor, here[pair[1]])
            else:
                refused[me] |= not accepts_gap(intersection, traffic, pair, features, hold, rules)
    for pair in all_pairs(intersection, traffic):
        if me in pair and _by_arrival(recording, traffic, pair):
            refused[me] |= _goes_second(recording, traffic, memory, pair, here, me)
    nobody = np.zeros(len(here), np.bool_)
    seen.driving[me, Feature.DELTA] = decide(intersection, traffic, memory, Says(refused, nobody, nobody))[me]
    return Decided(bool(seen.driving[me, Feature.DELTA]), np.asarray(seen.driving[me]), int(memory.waited[me]))


def _memories(
    recording: Recording,
    time: int,
    around: tuple[Traffic, list[int], int],
    remembered: tuple[bool, int],
    hold: Integers,
) -> Memory:
    """What everybody remembers: of the others what was recorded; who can no longer stop goes."""
    (traffic, here, me), (delta, waited) = around, remembered
    goes = np.array([cannot_stop(recording.intersection, traffic, k) for k in range(len(here))], np.bool_)
    since = np.array([has_waited(recording, k, time) for k in here], np.int64)
    goes[me], since[me] = delta, waited
    own_hold = hold.copy()
    own_hold[me] = -1
    memory = Memory(np.ones(len(here), np.bool_), goes, own_hold, since)
    counted = with_stops(recording.intersection, traffic, memory).waited[me]
    since[me] = counted if stop_is_asked(recording, here[me]) else waited + (waited > 0)
    return memory


def _by_arrival(recording: Recording, traffic: Traffic, pair: Integers) -> bool:
    conflict = conflict_of(recording.intersection, traffic, int(pair[0]), int(pair[1]))
    assert conflict is not None
    return conflict.by_arrival


def _goes_second(
    recording: Recording, traffic: Traffic, memory: Memory, pair: Integers, here: list[int], me: int
) -> bool:
    """Whether the actor waits for the other one of an all-way stop."""
    i, j = int(pair[0]), int(pair[1])
    if recording.rules is None:
        way = -1 if went_second(recording, (here[i], here[j])) == here[i] else 1
    else:
        way = by_arrival(recording.intersection, traffic, memory, i, j)
    second = j if way == 1 else i
    return second == me and is_active(recording.intersection, traffic, memory.present, pair, way)


def begin(recording: Recording, actor: int) -> tuple[Ride, View]:
    """The actor's episode at its first recorded step."""
    track = recording.scene.tracks[actor]
    time = track.first_recorded
    position, speed = float(track.position[time - track.start]), float(track.speed[time - track.start])
    waited = waited_before(recording, actor, time)
    decided = actor_decides(recording, time, actor, position, speed, None, waited)
    ride = Ride(actor, time, position, speed, decided.delta, decided.delta, decided.waited)
    return ride, View(decided.features, decided.features)


def waited_before(recording: Recording, actor: int, time: int) -> int:
    """What the recorded actor has waited before this step."""
    return max(0, has_waited(recording, actor, time) - 1)


def is_actors_fault(
    recording: Recording, time: int, traffic: Traffic, here: list[int], me: int, other: int, waited: int
) -> bool:
    """Whether a collision of the actor with another vehicle is the actor's fault: right of way, then lane order."""
    both = [conflict_of(recording.intersection, traffic, *pair) for pair in ((me, other), (other, me))]
    conflicts = [one for one in both if one is not None]
    if len(conflicts) == 1 and recording.rules is None:
        pair = (me, other) if both[0] is not None else (other, me)
        return went_second(recording, (here[pair[0]], here[pair[1]])) == here[me]
    found = yielder_before_pga(recording.intersection, traffic, me, other)
    if found is None:
        return was_behind(recording, here[me], here[other])
    yielder, conflict = found
    pair = (yielder, other if yielder == me else me)
    if recording.rules is None:
        return went_second(recording, (here[pair[0]], here[pair[1]])) == here[me]
    theirs = has_waited(recording, here[other], time)
    if conflict.by_arrival and waited != theirs:
        return waited < theirs
    return yielder == me


def ride_on(recording: Recording, ride: Ride, action: float, bodies: str = "circles") -> RideStep:
    """One step of the replay; action in [-1, 1]."""
    intersection, actor = recording.intersection, ride.track
    track = recording.scene.tracks[actor]
    speed = max(0.0, ride.speed + TIME_STEP * NETWORK_ACCELERATION * action)
    position = ride.position + TIME_STEP * (ride.speed + speed) / 2
    acceleration = (speed - ride.speed) / TIME_STEP  # as reached, which the reward is about
    time = ride.time + 1
    at, fast = float(track.position[time - track.start]), float(track.speed[time - track.start])
    before = waited_before(recording, actor, time)
    expert = actor_decides(recording, time, actor, at, fast, ride.expert_delta, before)
    traffic, here, me = traffic_around(recording, time, actor, position, speed)
    if position >= intersection.routes[track.route].length:
        features = alone(intersection, traffic, me)
        ride = Ride(actor, time, position, speed, True, expert.delta, ride.waited)
        return RideStep(ride, View(features, expert.features), reward(features, acceleration, False), False, True)
    decided = actor_decides(recording, time, actor, position, speed, ride.delta, ride.waited)
    fault = any(
        collide(intersection, traffic, me, other, bodies)
        and is_actors_fault(recording, time, traffic, here, me, other, decided.waited)
        for other in range(len(here))
        if other != me
    )
    return RideStep(
        ride=Ride(actor, time, position, speed, decided.delta, expert.delta, decided.waited),
        view=View(decided.features, expert.features),
        reward=reward(decided.features, acceleration, fault),
        terminated=fault,
        truncated=not fault and time == track.stop - 1,
    )
