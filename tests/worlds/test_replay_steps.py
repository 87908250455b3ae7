"""The replay of the core equals its twin step by step, on recorded scenes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from intersection_env import _core
from intersection_env.features import Driving
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.reference.replay import waited_before
from tests.reference.worlds import Recording, Ride, RideStep, ride_on
from tests.support.recorded_windows import DECISIONS, MAP, Windows, recorded_windows, replayed_windows, rules_of
from tests.support.replay_cases import can_act
from tests.support.twins import CASES, twin_map
from tests.support.world_traces import outputs
from tests.support.worlds_cases import NUDGES, OBSERVATION_TOLERANCE, REWARD_TOLERANCE, ROUNDING, Arrays

SEEN = slice(Driving.ENTERS)  # what does not hang on a decision


def ride_of(state: Arrays, world: int, track: int) -> Ride:
    """A world of the core as the twin has it; track: its number within its scene."""
    return Ride(
        track,
        int(state["time"][world]),
        float(state["position"][world]),
        float(state["speed"][world]),
        bool(state["delta"][world]),
        bool(state["expert_delta"][world]),
        int(state["waited"][world]),
    )


def differs(seen: Arrays, after: Ride, truth: RideStep) -> str:
    """What the core's world does not share with its twin's; empty if nothing."""
    wrong = [name for name in ("terminated", "truncated") if bool(seen[name]) != getattr(truth, name)]
    wrong += [
        name
        for name in ("delta", "expert_delta", "waited", "time")
        if getattr(after, name) != getattr(truth.ride, name)
    ]
    numbers: list[tuple[str, Any, Any, float]] = [
        ("observation", seen["observation"], truth.view.observation, OBSERVATION_TOLERANCE),
        ("expert_observation", seen["expert_observation"], truth.view.expert_observation, OBSERVATION_TOLERANCE),
        ("reward", seen["reward"], truth.reward, REWARD_TOLERANCE),
        ("position", after.position, truth.ride.position, OBSERVATION_TOLERANCE),
        ("speed", after.speed, truth.ride.speed, OBSERVATION_TOLERANCE),
    ]
    wrong += [word for word, one, other, most in numbers if not np.allclose(one, other, atol=most, rtol=1e-5)]
    return ", ".join(wrong)


def is_on_a_knife_edge(recording: Recording, ride: Ride, action: float, bodies: str) -> bool:
    """As `worlds_cases.is_on_a_knife_edge`: the acting vehicle, and its recorded self, are moved by ±1e-4."""
    truth = ride_on(recording, ride, action, bodies)
    generator = np.random.default_rng(0)
    for _ in range(NUDGES):
        position, speed, push, own_position, own_speed = generator.choice([-1.0, 1.0], 5)
        moved = replace(ride, position=ride.position + ROUNDING * position, speed=ride.speed + ROUNDING * speed)
        track = recording.scene.tracks[ride.track]
        shifted = replace(track, position=track.position + ROUNDING * own_position)
        shifted = replace(shifted, speed=track.speed + ROUNDING * own_speed)
        tracks = list(recording.scene.tracks)
        tracks[ride.track] = shifted
        other = replace(recording, scene=replace(recording.scene, tracks=tuple(tracks)))
        nudged = ride_on(other, moved, action + push * 1e-6 / 6, bodies)
        seen = {"terminated": truth.terminated, "truncated": truth.truncated, "reward": truth.reward}
        views = {"observation": truth.view.observation, "expert_observation": truth.view.expert_observation}
        if differs_much({**seen, **views}, truth.ride, nudged):
            return True
    return False


def differs_much(seen: dict[str, Any], after: Ride, nudged: RideStep) -> bool:
    same = all(getattr(after, name) == getattr(nudged.ride, name) for name in ("delta", "expert_delta", "waited"))
    same = same and all(seen[name] == getattr(nudged, name) for name in ("terminated", "truncated"))
    near = np.allclose(seen["observation"], nudged.view.observation, atol=0.01)
    near = near and np.allclose(seen["expert_observation"], nudged.view.expert_observation, atol=0.01)
    return not (same and near and abs(seen["reward"] - nudged.reward) < 0.2)


# Core and twin


def random_rides(windows: Windows, count: int, generator: np.random.Generator) -> list[tuple[int, Ride]]:
    """Vehicles near where they were recorded, before their last step, mostly near their lines; any memories."""
    rides: list[tuple[int, Ride]] = []
    while len(rides) < count:
        number = int(generator.integers(len(windows.where)))
        one = windows.track(number)
        if not can_act(one):
            continue
        time = int(generator.integers(one.first_recorded, one.stop - 1))
        far = generator.choice([0.0, 1.0, 8.0, 16.0])
        road = twin_map(MAP).routes[one.route]
        limit = road.length - 4
        if abs(one.position[time - one.start] - road.stop_line) > 25 and generator.random() < 0.8:
            continue
        position = np.clip(one.position[time - one.start] + generator.normal(0, far), 0, limit)
        speed = max(0.0, one.speed[time - one.start] + generator.normal(0, far / 3))
        memory = generator.random(2) < 0.5
        rounded = float(np.float32(position)), float(np.float32(speed))
        _, track = windows.where[number]
        rides.append((number, Ride(track, time, *rounded, bool(memory[0]), bool(memory[1]))))
    return rides


def place(loop: _core.Replay, rides: list[tuple[int, Ride]]) -> None:
    """Puts each world's acting vehicle where its ride says."""
    loop.set_state(
        {
            **loop.state(),
            "track": np.array([number for number, _ in rides], np.int32),
            "time": np.array([ride.time for _, ride in rides], np.int32),
            "position": np.array([ride.position for _, ride in rides], np.float32),
            "speed": np.array([ride.speed for _, ride in rides], np.float32),
            "acceleration": np.zeros(len(rides), np.float32),
            "delta": np.array([ride.delta for _, ride in rides]),
            "expert_delta": np.array([ride.expert_delta for _, ride in rides]),
            "waited": np.array([ride.waited for _, ride in rides], np.int32),
            "done": np.zeros(len(rides), np.bool_),
        }
    )


@pytest.mark.parametrize(
    ("decisions", "bodies"), [(one, "circles") for one in DECISIONS] + [("critical_gap", "rectangles")]
)
def test_one_step_of_the_core_equals_the_twin(decisions: str, bodies: str) -> None:
    windows, rules = recorded_windows(), rules_of(decisions)
    generator = np.random.default_rng(1)
    rides = random_rides(windows, 250 * CASES, generator)
    actions = generator.uniform(-1, 1, len(rides)).astype(np.float32)
    loop = replayed_windows(len(rides), decisions=decisions, bodies=bodies)
    loop.reset(0, False)
    place(loop, rides)
    loop.action[:] = actions
    loop.step()
    seen, state = outputs(loop), loop.state()
    excused, met = 0, np.zeros(5, np.int64)
    for world, (number, ride) in enumerate(rides):
        recording, track = windows.recording(number, rules)
        truth = ride_on(recording, ride, float(actions[world]), bodies)
        after = ride_of(state, world, track)
        wrong = differs({name: seen[name][world] for name in seen}, after, truth)
        if wrong and not is_on_a_knife_edge(recording, ride, float(actions[world]), bodies):
            pytest.fail(f"world {world}: {wrong} differ; {ride}, {actions[world]}, leads to {after}, not {truth.ride}")
        excused += bool(wrong)
        view = truth.view.observation
        has_lead = view[Driving.LEAD_DISTANCE] < 100
        flags = [truth.terminated, truth.truncated, not truth.ride.delta, has_lead, truth.reward > 0]
        met += np.array(flags)
    assert excused <= 0.02 * len(rides)
    assert (met[[0, 2, 3]] >= 3).all(), f"too little happens for a test: {met}"


@pytest.mark.parametrize("decisions", DECISIONS)
def test_episodes_begin_as_the_twin_says(decisions: str) -> None:
    windows, rules = recorded_windows(), rules_of(decisions)
    able = windows.able()
    loop = replayed_windows(len(able), decisions=decisions)
    loop.reset(0, False)
    for world, number in enumerate(able):
        loop.start(world, number)
    state, wrong = loop.state(), 0
    np.testing.assert_array_equal(loop.track, able)
    for world, number in enumerate(able):
        recording, track = windows.recording(number, rules)
        ride, view = reference_worlds.begin(recording, track)
        assert ride_of(state, world, track).time == ride.time == int(loop.time[world])
        assert float(state["position"][world]) == pytest.approx(ride.position, abs=1e-4)
        assert float(state["speed"][world]) == pytest.approx(ride.speed, abs=1e-4)
        np.testing.assert_allclose(loop.observation[world, SEEN], view.observation[SEEN], atol=1e-3)
        wrong += bool(loop.observation[world, Driving.ENTERS] != view.observation[Driving.ENTERS])
        recorded = windows.track(number).acceleration(ride.time)
        assert loop.expert_acceleration[world] == pytest.approx(recorded, abs=1e-4)
    np.testing.assert_array_equal(loop.observation, loop.expert_observation)
    assert wrong <= 0.02 * len(able)
    assert not state["done"].any()


def test_expert_is_followed_to_the_end_whatever_the_actor_does() -> None:
    """Its observation, acceleration and decisions are those along the recording, by the twin."""
    windows, rules = recorded_windows(), rules_of("critical_gap")
    generator = np.random.default_rng(2)
    compared = wrong = 0
    for number in generator.choice(windows.able(), 6, replace=False).tolist():
        recording, track = windows.recording(number, rules)
        loop = replayed_windows(1, decisions="critical_gap")
        loop.reset(0, False)
        loop.start(0, number)
        ride, _ = reference_worlds.begin(recording, track)
        one, delta = windows.track(number), ride.expert_delta
        while not loop.state()["done"][0]:
            loop.action[:] = generator.uniform(-0.5, 0.5)
            loop.step()
            time = int(loop.time[0])
            at, fast = float(one.position[time - one.start]), float(one.speed[time - one.start])
            waited = waited_before(recording, track, time)
            decided = reference_worlds.actor_decides(recording, time, track, at, fast, delta, waited)
            delta = decided.delta
            np.testing.assert_allclose(loop.expert_observation[0, SEEN], decided.features[SEEN], atol=1e-3)
            wrong += bool(loop.expert_observation[0, Driving.ENTERS] != decided.features[Driving.ENTERS])
            assert float(loop.expert_acceleration[0]) == pytest.approx(one.acceleration(time), abs=1e-4)
            compared += 1
    assert compared > 60
    assert wrong <= 0.02 * compared


def test_acting_as_recorded_stays_near_the_recorded_track() -> None:
    """With the recorded changes of speed; and what is then seen is nearly what the expert sees."""
    windows, checked = recorded_windows(), 0
    for number in windows.able():
        one = windows.track(number)
        if one.observed.sum() < 30 or number % 2:
            continue
        loop = replayed_windows(1)
        loop.reset(0, False)
        loop.start(0, number)
        for time in range(one.first_recorded, one.stop - 1):
            assert not loop.state()["done"][0]
            change = one.speed[time + 1 - one.start] - loop.state()["speed"][0]
            loop.action[:] = change / reference.TIME_STEP / 6
            loop.step()
            away = float(loop.state()["position"][0]) - one.position[time + 1 - one.start]
            assert abs(away) < 0.6
            to_line, recorded = (
                seen[0, Driving.DISTANCE_TO_STOP_LINE] for seen in (loop.observation, loop.expert_observation)
            )
            assert abs(to_line - recorded + away) < 1e-3
        checked += 1
    assert checked >= 5
