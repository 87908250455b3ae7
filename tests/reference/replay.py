"""Replay: one vehicle of a recorded scene acts, all others are where they were recorded."""

from dataclasses import dataclass

import numpy as np

from tests.reference.collisions import collide
from tests.reference.decide import Says, accepts_gap, decide
from tests.reference.drive import NETWORK_ACCELERATION
from tests.reference.intersection import Floats
from tests.reference.memory import Memory, initial_memory
from tests.reference.observe import Feature, alone, observe
from tests.reference.pairs import all_pairs, conflict_of, is_active
from tests.reference.recorded import (
    Recording,
    recorded_holds,
    recorded_traffic,
    tracks_at,
    was_behind,
    yielder_was_first,
)
from tests.reference.reward import reward
from tests.reference.traffic import TIME_STEP, Traffic, rear


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
    seen.driving[me, Feature.DELTA] = decide(intersection, traffic, memory, Says(refused, nobody, nobody))[me]
    return bool(seen.driving[me, Feature.DELTA]), np.asarray(seen.driving[me])


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
