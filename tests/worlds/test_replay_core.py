"""The replay of the core equals its twin on recorded scenes; small scenes by hand show each of its rules."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from data.build import build
from intersection_env import Intersection, _core
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Recording, Ride, RideStep, Scene, ride_on
from tests.support.paths import RECORDINGS
from tests.support.replay_cases import can_act, core_of_scenes, driven, replay, scene_of, window
from tests.support.rollout_cases import check_rollouts
from tests.support.twins import CASES, twin_map
from tests.support.worlds_cases import (
    NUDGES,
    OBSERVATION_TOLERANCE,
    REWARD_TOLERANCE,
    ROUNDING,
    Arrays,
    rules_and_policy,
)

DECISIONS = ["recording", "critical_gap", "sumo", "network"]
OUTPUTS = ("observation", "expert_observation", "expert_acceleration", "reward", "terminated", "truncated")
STEPS = 110  # of a window; twenty seconds are two or three queues
T = "t_junction"
D_STOP, SPEED, D_LEAD, V_LEAD, DELTA = 0, 1, 9, 10, 11


@dataclass(frozen=True)
class Windows:
    """Stretches of recorded scenes, and which track of which scene a number means."""

    scenes: list[Scene]
    where: list[tuple[int, int]]


@pytest.fixture(scope="module")
def windows() -> Windows:
    scenes = build(RECORDINGS, Intersection.load("bendplatz"), ["12"], progress=False)
    chosen = [window(scenes["12/0"], 60, STEPS), window(scenes["12/2"], 300, STEPS), window(scenes["12/3"], 90, STEPS)]
    where = [(k, track) for k, scene in enumerate(chosen) for track in range(len(scene.tracks))]
    return Windows(chosen, where)


def outputs(loop: _core.Replay) -> Arrays:
    return {name: getattr(loop, name).copy() for name in OUTPUTS}


def ride_of(state: Arrays, world: int, track: int) -> Ride:
    """A world of the core as the twin has it; track: its number within its scene."""
    return Ride(
        track,
        int(state["time"][world]),
        float(state["position"][world]),
        float(state["speed"][world]),
        bool(state["delta"][world]),
        bool(state["expert_delta"][world]),
    )


def differs(seen: Arrays, after: Ride, truth: RideStep) -> str:
    """What the core's world does not share with its twin's; empty if nothing."""
    wrong = [name for name in ("terminated", "truncated") if bool(seen[name]) != getattr(truth, name)]
    wrong += [name for name in ("delta", "expert_delta", "time") if getattr(after, name) != getattr(truth.ride, name)]
    numbers: list[tuple[str, Any, Any, float]] = [
        ("observation", seen["observation"], truth.view.observation, OBSERVATION_TOLERANCE),
        ("expert_observation", seen["expert_observation"], truth.view.expert_observation, OBSERVATION_TOLERANCE),
        ("reward", seen["reward"], truth.reward, REWARD_TOLERANCE),
        ("position", after.position, truth.ride.position, OBSERVATION_TOLERANCE),
        ("speed", after.speed, truth.ride.speed, OBSERVATION_TOLERANCE),
    ]
    wrong += [word for word, one, other, most in numbers if not np.allclose(one, other, atol=most, rtol=1e-5)]
    return ", ".join(wrong)


def is_on_a_knife_edge(recording: Recording, ride: Ride, action: float) -> bool:
    """As `worlds_cases.is_on_a_knife_edge`: the acting vehicle, and its recorded self, are moved by ±1e-4."""
    truth = ride_on(recording, ride, action)
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
        nudged = ride_on(other, moved, action + push * 1e-6 / 6)
        seen = {"terminated": truth.terminated, "truncated": truth.truncated, "reward": truth.reward}
        views = {"observation": truth.view.observation, "expert_observation": truth.view.expert_observation}
        if differs_much({**seen, **views}, truth.ride, nudged):
            return True
    return False


def differs_much(seen: dict[str, Any], after: Ride, nudged: RideStep) -> bool:
    same = all(getattr(after, name) == getattr(nudged.ride, name) for name in ("delta", "expert_delta"))
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
        scene, track = windows.where[number]
        one = windows.scenes[scene].tracks[track]
        if one.first_recorded >= one.stop - 1:
            continue
        time = int(generator.integers(one.first_recorded, one.stop - 1))
        far = generator.choice([0.0, 1.0, 8.0, 16.0])
        road = twin_map("bendplatz").routes[one.route]
        limit = road.length - 4
        if abs(one.position[time - one.start] - road.stop_line) > 25 and generator.random() < 0.8:
            continue
        position = np.clip(one.position[time - one.start] + generator.normal(0, far), 0, limit)
        speed = max(0.0, one.speed[time - one.start] + generator.normal(0, far / 3))
        memory = generator.random(2) < 0.5
        rounded = float(np.float32(position)), float(np.float32(speed))
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
            "done": np.zeros(len(rides), np.bool_),
        }
    )


@pytest.mark.parametrize("decisions", DECISIONS)
def test_one_step_of_the_core_equals_the_twin(windows: Windows, decisions: str) -> None:
    rules = None if decisions == "recording" else rules_and_policy(decisions)[0]
    generator = np.random.default_rng(1)
    rides = random_rides(windows, 250 * CASES, generator)
    actions = generator.uniform(-1, 1, len(rides)).astype(np.float32)
    loop = replay("bendplatz", windows.scenes, len(rides), decisions=decisions)
    loop.reset(0, False)
    place(loop, rides)
    loop.action[:] = actions
    loop.step()
    seen, state = outputs(loop), loop.state()
    excused, met = 0, np.zeros(5, np.int64)
    for world, (number, ride) in enumerate(rides):
        scene, track = windows.where[number]
        recording = Recording(twin_map("bendplatz"), windows.scenes[scene], rules)
        truth = ride_on(recording, ride, float(actions[world]))
        after = ride_of(state, world, track)
        wrong = differs({name: seen[name][world] for name in OUTPUTS}, after, truth)
        if wrong and not is_on_a_knife_edge(recording, ride, float(actions[world])):
            pytest.fail(f"world {world}: {wrong} differ; {ride}, {actions[world]}, leads to {after}, not {truth.ride}")
        excused += bool(wrong)
        view = truth.view.observation
        flags = [truth.terminated, truth.truncated, not truth.ride.delta, view[D_LEAD] < 100, truth.reward > 0]
        met += np.array(flags)
    assert excused <= 0.02 * len(rides)
    assert (met[[0, 2, 3]] >= 3).all(), f"too little happens for a test: {met}"


@pytest.mark.parametrize("decisions", DECISIONS)
def test_episodes_begin_as_the_twin_says(windows: Windows, decisions: str) -> None:
    rules = None if decisions == "recording" else rules_and_policy(decisions)[0]
    able = [k for k, (scene, track) in enumerate(windows.where) if can_act(windows.scenes[scene].tracks[track])]
    loop = replay("bendplatz", windows.scenes, len(able), decisions=decisions)
    loop.reset(0, False)
    for world, number in enumerate(able):
        loop.start(world, number)
    state, wrong = loop.state(), 0
    np.testing.assert_array_equal(loop.track, able)
    for world, number in enumerate(able):
        scene, track = windows.where[number]
        recording = Recording(twin_map("bendplatz"), windows.scenes[scene], rules)
        ride, view = reference_worlds.begin(recording, track)
        assert ride_of(state, world, track).time == ride.time == int(loop.time[world])
        assert float(state["position"][world]) == pytest.approx(ride.position, abs=1e-4)
        assert float(state["speed"][world]) == pytest.approx(ride.speed, abs=1e-4)
        np.testing.assert_allclose(loop.observation[world, :11], view.observation[:11], atol=1e-3)
        wrong += bool(loop.observation[world, DELTA] != view.observation[DELTA])
        recorded = windows.scenes[scene].tracks[track]
        assert loop.expert_acceleration[world] == pytest.approx(recorded.acceleration(ride.time), abs=1e-4)
    np.testing.assert_array_equal(loop.observation, loop.expert_observation)
    assert wrong <= 0.02 * len(able)
    assert not state["done"].any()


def test_expert_is_followed_to_the_end_whatever_the_actor_does(windows: Windows) -> None:
    """Its observation, acceleration and decisions are those along the recording, by the twin."""
    rules = rules_and_policy("critical_gap")[0]
    generator = np.random.default_rng(2)
    able = [k for k, (scene, track) in enumerate(windows.where) if can_act(windows.scenes[scene].tracks[track])]
    compared = wrong = 0
    for number in generator.choice(able, 6, replace=False).tolist():
        scene, track = windows.where[number]
        recording = Recording(twin_map("bendplatz"), windows.scenes[scene], rules)
        loop = replay("bendplatz", windows.scenes, decisions="critical_gap")
        loop.reset(0, False)
        loop.start(0, number)
        ride, _ = reference_worlds.begin(recording, track)
        one, delta = windows.scenes[scene].tracks[track], ride.expert_delta
        while not loop.state()["done"][0]:
            loop.action[:] = generator.uniform(-0.5, 0.5)
            loop.step()
            time = int(loop.time[0])
            at, fast = float(one.position[time - one.start]), float(one.speed[time - one.start])
            delta, features = reference_worlds.actor_decides(recording, time, track, at, fast, delta)
            np.testing.assert_allclose(loop.expert_observation[0, :11], features[:11], atol=1e-3)
            wrong += bool(loop.expert_observation[0, DELTA] != features[DELTA])
            assert float(loop.expert_acceleration[0]) == pytest.approx(one.acceleration(time), abs=1e-4)
            compared += 1
    assert compared > 60
    assert wrong <= 0.02 * compared


def test_acting_as_recorded_stays_near_the_recorded_track(windows: Windows) -> None:
    """With the recorded changes of speed; and what is then seen is nearly what the expert sees."""
    checked = 0
    for number, (scene, track) in enumerate(windows.where):
        one = windows.scenes[scene].tracks[track]
        if not can_act(one) or one.observed.sum() < 30 or number % 2:
            continue
        loop = replay("bendplatz", windows.scenes)
        loop.reset(0, False)
        loop.start(0, number)
        for time in range(one.first_recorded, one.stop - 1):
            assert not loop.state()["done"][0]
            change = one.speed[time + 1 - one.start] - loop.state()["speed"][0]
            loop.action[:] = change / reference.TIME_STEP / 6
            loop.step()
            away = float(loop.state()["position"][0]) - one.position[time + 1 - one.start]
            assert abs(away) < 0.6
            assert abs(loop.observation[0, D_STOP] - loop.expert_observation[0, D_STOP] + away) < 1e-3
        checked += 1
    assert checked >= 5


# Chance


def trace(loop: _core.Replay, steps: int, seed: int, worlds: slice = slice(None), count: int = 40) -> bytes:
    """Everything that comes out of some worlds over random actions, which are those of `count` worlds."""
    generator = np.random.default_rng(seed)
    parts = []
    for _ in range(steps):
        loop.action[:] = generator.uniform(-1, 1, count)[: len(loop.action)].astype(np.float32)
        loop.step()
        parts += [getattr(loop, name)[worlds].tobytes() for name in (*OUTPUTS, "track", "time")]
        parts.append(loop.final_observation[worlds][(loop.terminated | loop.truncated)[worlds]].tobytes())
    state = loop.state()
    return b"".join([*parts, *(state[name][worlds].tobytes() for name in sorted(state))])


@pytest.mark.parametrize("autoreset", ["same_step", "next_step"])
def test_same_seed_gives_the_same_bytes(windows: Windows, autoreset: str) -> None:
    """With one thread and with two, in a batch of one world and of forty."""
    several = [replay("bendplatz", windows.scenes, 40, autoreset=autoreset, threads=threads) for threads in (1, 2)]
    one = replay("bendplatz", windows.scenes, 1, autoreset=autoreset)
    for loop in (*several, one):
        loop.reset(11, False)
    traces = [trace(loop, 300, 2) for loop in several]
    assert traces[0] == traces[1]
    several[0].reset(11, False)
    assert trace(several[0], 300, 2, slice(0, 1)) == trace(one, 300, 2, slice(0, 1))
    several[0].reset(12, False)
    assert trace(several[0], 300, 2, slice(0, 1)) != trace(one, 300, 2, slice(0, 1))


@pytest.mark.parametrize("decisions", DECISIONS)
def test_v3_and_v4_give_the_same_bytes(windows: Windows, decisions: str) -> None:
    if not {"v3", "v4"} <= set(_core.available_kernels()):
        pytest.skip("this machine has no AVX-512: there is nothing to compare")
    traces = []
    for isa in ("v3", "v4"):
        how = {"decisions": decisions, "autoreset": "same_step", "isa": isa}
        loop = replay("bendplatz", windows.scenes, 40, **how)  # type: ignore[arg-type]
        loop.reset(13, True)
        traces.append(trace(loop, 200, 4))
    assert traces[0] == traces[1]


@pytest.mark.parametrize("through_pickle", [False, True])
@pytest.mark.parametrize("autoreset", ["off", "same_step", "next_step"])
def test_state_given_back_goes_on_to_the_same_bytes(windows: Windows, autoreset: str, through_pickle: bool) -> None:
    one, other = (replay("bendplatz", windows.scenes, 20, autoreset=autoreset) for _ in range(2))
    one.reset(5, True)
    trace(one, 20, 1)
    state = one.state()
    other.reset(99, False)
    other.set_state(pickle.loads(pickle.dumps(state)) if through_pickle else state)
    for name in ("observation", "expert_observation", "expert_acceleration", "track", "time"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)
    assert trace(one, 60, 6) == trace(other, 60, 6)


def test_resets_draw_all_actors_and_nobody_else(windows: Windows) -> None:
    able = [k for k, (scene, track) in enumerate(windows.where) if can_act(windows.scenes[scene].tracks[track])]
    actors = able[::2]
    loop = replay("bendplatz", windows.scenes, 30 * len(actors), actors=actors)
    loop.reset(3, False)
    assert set(loop.track.tolist()) == set(actors)
    begins = {number: windows.scenes[scene].tracks[track] for number, (scene, track) in enumerate(windows.where)}
    assert loop.time.tolist() == [begins[number].first_recorded for number in loop.track.tolist()]
    before = loop.track.copy()
    mask = np.zeros(len(before), np.bool_)
    mask[::3] = True
    loop.reset_worlds(mask)
    np.testing.assert_array_equal(loop.track[~mask], before[~mask])
    assert (loop.track[mask] != before[mask]).mean() > 0.5


def test_desynchronised_worlds_begin_anywhere_within_their_tracks(windows: Windows) -> None:
    able = [k for k, (scene, track) in enumerate(windows.where) if can_act(windows.scenes[scene].tracks[track])]
    loop = replay("bendplatz", windows.scenes, 400, actors=able)
    loop.reset(3, True)
    state, share = loop.state(), []
    for world in range(400):
        scene, track = windows.where[int(loop.track[world])]
        one, time = windows.scenes[scene].tracks[track], int(loop.time[world])
        assert one.first_recorded <= time < one.stop - 1
        assert float(state["position"][world]) == pytest.approx(one.position[time - one.start], abs=1e-4)
        share += [(time - one.first_recorded) / (one.stop - 2 - one.first_recorded)] if one.stop > 30 else []
    assert 0.35 < np.mean(share) < 0.65
    assert min(share) < 0.1
    assert max(share) > 0.9


@pytest.mark.parametrize("decisions", DECISIONS)
def test_rollout_is_what_stepping_gives(windows: Windows, decisions: str) -> None:
    rolling, stepping = (
        replay("bendplatz", windows.scenes, 40, decisions=decisions, autoreset="same_step", threads=threads)
        for threads in (2, 1)
    )
    rolling.reset(3, True)
    stepping.reset(4, False)
    met = check_rollouts(rolling, stepping, 40)
    assert min(met.values()) > 1e-3


# By hand


def hand(*tracks: reference_worlds.Track, decisions: str = "recording", name: str = T) -> _core.Replay:
    """One world in which the first of the tracks acts."""
    loop = replay(name, [scene_of(*tracks)], decisions=decisions)
    loop.reset(0, False)
    loop.start(0, 0)
    return loop


def go(loop: _core.Replay, steps: int, acceleration: float = 0.0) -> list[Arrays]:
    """The outputs of some steps, until the episode ends."""
    seen = []
    for _ in range(steps):
        loop.action[:] = acceleration / 6
        loop.step()
        seen.append(outputs(loop) | {"state": loop.state()["position"]})
        if loop.terminated[0] or loop.truncated[0]:
            break
    return seen


def column(seen: list[Arrays], feature: int) -> NDArray[Any]:
    return np.array([one["observation"][0, feature] for one in seen])


def test_kinematics_never_go_backwards() -> None:
    loop = hand(driven(T, "W-E", 50.0, 1.0))
    seen = go(loop, 2, -6.0)
    np.testing.assert_allclose(column(seen, SPEED), [0.0, 0.0], atol=1e-6)
    assert float(loop.state()["position"][0]) == pytest.approx(50.0 + 0.1 * 1.0, abs=1e-4)
    reached = [(0 - 1) / 0.2, 0.0]  # a vehicle that stands does not brake, whatever its pedal
    by_hand = [2 - 0.01 * reached[0] ** 2 - 1 - 20 - 20, 2 - 20]
    np.testing.assert_allclose([float(one["reward"][0]) for one in seen], by_hand, atol=1e-3)


def test_reward_is_that_of_the_closed_loop() -> None:
    (seen,) = go(hand(driven(T, "W-E", 50.0, 10.0)), 1, 3.0)
    speed = 10 + 0.2 * 3
    assert float(seen["reward"][0]) == pytest.approx(2 - 0.01 * 9 - 1 - 20 / (50 / 3.6) * (50 / 3.6 - speed), abs=1e-3)


def test_episode_is_truncated_with_the_last_recorded_step() -> None:
    loop = hand(driven(T, "W-E", 50.0, 5.0, steps=11), driven(T, "E-W", 50.0, 5.0, steps=40))
    seen = go(loop, 20)
    assert len(seen) == 10
    assert [bool(one["truncated"][0]) for one in seen] == [False] * 9 + [True]
    assert not any(one["terminated"][0] for one in seen)
    assert int(loop.time[0]) == 10
    assert float(loop.final_observation[0, D_STOP]) == pytest.approx(149 - 60 - 2, abs=1e-3)


def test_episode_ends_with_the_scene() -> None:
    short = replace(scene_of(driven(T, "W-E", 50.0, 5.0, steps=21)), steps=21)
    loop = replay(T, [short, scene_of(driven(T, "W-E", 50.0, 5.0, steps=80))])
    loop.reset(0, False)
    loop.start(0, 0)
    assert len(go(loop, 40)) == 20


def test_episode_ends_where_the_route_does() -> None:
    """The recorded vehicle does not get there."""
    loop = hand(driven(T, "W-E", 310.0, 10.0, steps=9), driven(T, "W-E", 290.0, 10.0, steps=9))
    seen = go(loop, 20, 6.0)
    last = seen[-1]
    assert len(seen) < 8
    assert (bool(last["terminated"][0]), bool(last["truncated"][0])) == (False, True)
    assert float(loop.final_observation[0, D_LEAD]) == 100.0
    assert float(last["reward"][0]) > -200


def test_vehicle_that_was_behind_never_becomes_the_lead() -> None:
    """Also once it has driven through the acting one, which stops in its way; and that is nobody's fault here."""
    loop = hand(driven(T, "W-E", 50.0, 10.0), driven(T, "W-E", 30.0, 10.0))
    seen = go(loop, 40, -5.0)
    assert len(seen) == 40
    np.testing.assert_array_equal(column(seen, D_LEAD), 100.0)
    assert not any(one["terminated"][0] for one in seen)


def test_vehicle_that_was_ahead_leads_and_may_not_be_hit() -> None:
    loop = hand(driven(T, "W-E", 30.0, 10.0), driven(T, "W-E", 50.0, 10.0))
    seen = go(loop, 40, 2.0)
    time = 0.2 * np.arange(1, len(seen) + 1)
    np.testing.assert_allclose(column(seen, D_LEAD), 20 - 4 - time**2, atol=1e-3)
    np.testing.assert_allclose(column(seen, V_LEAD), 10.0, atol=1e-5)
    assert seen[-1]["terminated"][0]
    assert seen[-1]["reward"][0] < -4000


def test_lead_order_before_a_split_is_that_of_the_first_moment_both_are_there() -> None:
    """The one on W-S was ahead when the other appeared, and only then was overtaken in the recording."""
    slow = driven(T, "W-S", 60.0, 0.5)
    for actor, other, leads in ((slow, False, False), (driven(T, "W-E", 30.0, 10.0), True, True)):
        second = slow if other else driven(T, "W-E", 30.0, 10.0)
        seen = go(hand(actor, second), 3, -0.1)
        assert (column(seen, D_LEAD) < 100).all() == leads


@pytest.mark.parametrize(("ahead", "leads"), [(4.5, True), (-4.5, False)])
def test_lead_order_beyond_a_merge_is_who_reached_it_first(ahead: float, leads: bool) -> None:
    """S-E and W-E merge at 101 and 165 m: positions on W-E are 64.0820762 m more."""
    other = driven(T, "W-E", 120.0 + 64.0820762 - 40 + ahead, 10.0)
    actor = driven(T, "S-E", 120.0 - 40, 10.0)
    loop = hand(actor, other)
    seen = go(loop, 45, -0.5)
    beyond = np.array([float(one["observation"][0, D_STOP]) for one in seen]) < -10
    assert beyond.any()
    assert (column(seen, D_LEAD)[beyond] < 100).any() == leads
    assert not any(one["terminated"][0] for one in seen[:25])


@pytest.mark.parametrize(("ahead", "leads"), [(15.0, True), (-15.0, False)])
def test_of_two_beyond_a_merge_when_the_scene_begins_the_one_ahead_leads(ahead: float, leads: bool) -> None:
    """Nothing tells who reached it first."""
    loop = hand(driven(T, "S-E", 120.0, 8.0), driven(T, "W-E", 120.0 + 64.0820762 + ahead, 8.0))
    assert float(loop.observation[0, D_LEAD]) == pytest.approx(15.0 - 4 if leads else 100.0, abs=1e-3)


def foe_passing(seconds: float, speed: float = 10.0) -> reference_worlds.Track:
    """On W-E, its front this long before it reaches the conflict with S-W (155.785958 m)."""
    return driven(T, "W-E", 155.785958 - 2 - seconds * speed, speed)


def yielding(seconds: float, speed: float = 4.0) -> reference_worlds.Track:
    """On S-W, its front this long before it reaches the conflict with W-E (99.4648575 m)."""
    return driven(T, "S-W", 99.4648575 - 2 - seconds * speed, speed)


def test_recording_decides_as_the_recorded_vehicle_did() -> None:
    """First at the conflict: it may enter at once, though the gap is small; second: when the other is through."""
    first = go(hand(yielding(3.05), foe_passing(4.05)), 30)
    assert column(first, DELTA).all()
    second = go(hand(yielding(5.05), foe_passing(2.05)), 30, -0.5)
    passed = np.array([155.785958 - 2 - 20.5 + 2.0 * k for k in range(1, len(second) + 1)]) >= 160.716451
    np.testing.assert_array_equal(column(second, DELTA), passed)
    assert passed.any()


def test_policy_decides_whatever_the_recorded_vehicle_did() -> None:
    early = column(go(hand(yielding(3.05), foe_passing(4.05), decisions="critical_gap"), 5, -1.0), DELTA)
    assert not early.any()
    alone = column(go(hand(yielding(3.05), decisions="critical_gap"), 5, -1.0), DELTA)
    assert alone.all()


def test_who_reaches_a_conflict_within_one_step_of_the_other_was_second() -> None:
    """And so was who never reached it, though the other did not either."""
    tie = go(hand(yielding(3.05), foe_passing(3.05)), 5, -1.0)
    assert not column(tie, DELTA).any()
    neither = [replace_steps(one, 8) for one in (yielding(4.05), foe_passing(4.05))]
    assert not column(go(hand(*neither), 5, -1.0), DELTA).any()


def replace_steps(track: reference_worlds.Track, steps: int) -> reference_worlds.Track:
    arrays = {name: getattr(track, name)[:steps] for name in ("position", "speed", "observed")}
    return replace(track, **arrays)


@pytest.mark.parametrize("waited", [True, False])
def test_recorded_vehicle_that_was_held_does_not_hold_the_acting_one(waited: bool) -> None:
    """NE-SE yields to SW-NE, which stands at its line and yielded, or not, to SE-NW, more than 6 s away."""
    name = "bendplatz"
    route = {one.id: one for one in twin_map(name).routes}
    foe = driven(name, "SW-NE", route["SW-NE"].stop_line - 3, [0.0] * 10 + [5.0 if not waited else 0.0] * 50)
    far = driven(name, "SE-NW", route["SE-NW"].stop_line - 2 - 80, 10.0)
    actor = driven(name, "NE-SE", route["NE-SE"].stop_line - 22, 4.0)
    seen = go(hand(actor, foe, far, decisions="critical_gap", name=name), 4)
    assert column(seen, DELTA).tolist() == [float(waited)] * 4


@pytest.mark.parametrize(("decisions", "fault"), [("recording", True), ("critical_gap", False)])
def test_recorded_order_says_who_is_to_blame(decisions: str, fault: bool) -> None:
    """The one with priority was second in the recording, and now drives into the yielder."""
    yielder = driven(T, "S-W", 99.4648575 - 2 - 4.0, [4.0] * 8 + [1.0] * 52)
    seen = go(hand(foe_passing(5.0), yielder, decisions=decisions), 50, 2.0)
    assert bool(seen[-1]["terminated"][0]) == fault
    assert (float(seen[-1]["reward"][0]) < -4000) == fault
    assert (len(seen) < 40) == fault


@pytest.mark.parametrize(("actor", "fault"), [("yielder", True), ("prioritized", False)])
def test_where_neither_reached_the_conflict_the_yielder_is_to_blame(actor: str, fault: bool) -> None:
    """By the recording, which ends before; both would touch where they come to a stand."""
    yielder = driven(T, "S-W", 95.5, 4.0, steps=3)
    prioritized = driven(T, "W-E", 144.5, 10.0, steps=3)
    tracks = (yielder, prioritized) if actor == "yielder" else (prioritized, yielder)
    (first, *_) = go(hand(*tracks), 1)
    assert bool(first["terminated"][0]) == fault


def test_yielder_that_was_first_is_not_to_blame_as_recorded_but_is_by_rule() -> None:
    """It enters as it was recorded to, but stops halfway, and the other comes."""
    tracks = yielding(1.05), foe_passing(3.05)
    for decisions, fault in (("recording", False), ("critical_gap", True)):
        loop = hand(*tracks, decisions=decisions)
        seen = [*go(loop, 10, 0.0), *go(loop, 20, -6.0)]
        assert any(one["terminated"][0] for one in seen) == fault


def test_vehicles_come_and_go() -> None:
    """A lead is there from its first recorded step to its last."""
    loop = hand(driven(T, "W-E", 30.0, 5.0), driven(T, "W-E", 60.0, 5.0, start=5, steps=10))
    seen = go(loop, 30)
    there = [5 <= time < 15 for time in range(1, len(seen) + 1)]
    np.testing.assert_array_equal(column(seen, D_LEAD) < 100, there)


def test_acting_vehicle_begins_at_its_first_recorded_step() -> None:
    """Not where it was extrapolated to."""
    track = driven(T, "W-E", 30.0, 5.0, start=2)
    observed = track.observed.copy()
    observed[:7] = False
    loop = hand(replace(track, observed=observed))
    assert int(loop.time[0]) == 9
    assert float(loop.observation[0, D_STOP]) == pytest.approx(149 - 30 - 7 - 2, abs=1e-3)


def test_memory_at_the_start_is_the_models() -> None:
    """Recorded as second, and standing: at 4 m/s, it has to wait if it can still stop within 2 m, else has entered."""
    for before, enters in ((0.5, True), (30.0, False)):
        actor = driven(T, "S-W", 97.1019404 - 2 - before, 4.0)
        foe = driven(T, "W-E", 155.785958 - 2 - 10.0, 10.0)
        standing = replace(actor, position=actor.position[0] + np.zeros(60))  # as second; its speed is kept
        loop = hand(standing, foe)
        assert bool(loop.observation[0, DELTA]) == enters


@pytest.mark.parametrize("autoreset", ["off", "same_step", "next_step"])
def test_ended_episode_goes_on_as_the_mode_says(autoreset: str) -> None:
    scene = scene_of(driven(T, "W-E", 50.0, 5.0, steps=4), driven(T, "W-E", 20.0, 5.0, steps=30))
    loop = replay(T, [scene], 2, actors=[1], autoreset=autoreset)
    loop.reset(0, False)
    loop.start(0, 0)
    for _ in range(3):
        loop.action[:] = 0
        loop.step()
    assert loop.truncated.tolist() == [True, False]
    assert float(loop.final_observation[0, D_STOP]) == pytest.approx(149 - 53 - 2, abs=1e-3)
    assert loop.track.tolist() == ([1, 1] if autoreset == "same_step" else [0, 1])
    assert loop.time.tolist() == ([0, 3] if autoreset == "same_step" else [3, 3])
    assert loop.state()["done"].tolist() == [autoreset != "same_step", False]
    loop.action[:] = 1
    loop.step()
    if autoreset == "off":
        assert (loop.track.tolist(), loop.time.tolist()) == ([0, 1], [3, 4])
        np.testing.assert_array_equal(loop.observation[0], loop.final_observation[0])
        return
    assert loop.track.tolist() == [1, 1]
    assert loop.time.tolist() == ([1, 4] if autoreset == "same_step" else [0, 4])
    assert not loop.truncated.any()
    if autoreset == "next_step":
        assert loop.reward[0] == 0
        assert float(loop.observation[0, SPEED]) == pytest.approx(5.0, abs=1e-4)


def test_malformed_scenes_are_refused() -> None:
    arrays = core_of_scenes([scene_of(driven(T, "W-E", 50.0, 5.0), driven(T, "E-W", 50.0, 5.0))])
    _, policy = rules_and_policy("critical_gap")

    def build_with(actors: list[int], **changes: NDArray[Any]) -> _core.Replay:
        chosen = np.array(actors, np.int32)
        return _core.Replay(Intersection.load(T).core, policy, True, {**arrays, **changes}, chosen, 1, "off", 1)

    build_with([0, 1])
    for wrong in (
        {"track_route": np.array([0, 99], np.int32)},
        {"track_samples": np.array([0, 60], np.int64)},
        {"track_samples": np.array([0, 90, 60], np.int64)},
        {"scene_tracks": np.array([0, 3], np.int64)},
        {"position": arrays["position"][:-1].copy()},
        {"speed": np.full_like(arrays["speed"], np.nan)},
    ):
        with pytest.raises((ValueError, TypeError)):
            build_with([0], **wrong)
    for actors in ([], [2], [-1]):
        with pytest.raises(ValueError, match=r"act|track"):
            build_with(actors)
