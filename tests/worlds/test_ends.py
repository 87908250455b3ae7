"""Ended worlds of both kinds: what is told of the end, and how they go on in each mode of autoreset."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env import _core
from intersection_env.features import Driving
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Rules
from tests.support.replay_by_hand import T
from tests.support.replay_cases import driven, replay, scene_of
from tests.support.twins import twin_map
from tests.support.world_traces import act
from tests.support.worlds_cases import closed_loop, twin_of


def test_last_cycle_truncates_everybody() -> None:
    loop = closed_loop("t_junction", 3, 2, max_cycles=4)
    loop.reset(0, False)
    for cycle in range(1, 5):
        loop.action[:] = 0
        loop.step()
        assert (loop.state()["cycle"] == cycle).all()
        assert (loop.done == (cycle == 4)).all()
        assert (loop.truncated == (cycle == 4)).all()
    assert not loop.terminated.any()
    np.testing.assert_array_equal(loop.final_observation, loop.observation)


def crash(autoreset: str) -> _core.ClosedLoop:
    """Two worlds after a step: in the first one vehicle has run into another, in the second nothing has happened."""
    loop = closed_loop("t_junction", 2, 2, autoreset=autoreset)
    loop.reset(1, False)
    state = loop.state()
    state["route"][:] = 0
    state["position"][:] = [[50.0, 53.5], [50.0, 100.0]]
    for name, value in (("speed", 5.0), ("length", 4.0), ("width", 2.0)):
        state[name][:] = value
    state["delta"][:] = True
    state["hold"][:] = -1
    loop.set_state(state)
    loop.action[:] = 0
    loop.step()
    assert loop.terminated.tolist() == [[True, False], [False, False]]
    assert loop.truncated.tolist() == [[False, True], [False, False]]
    assert loop.done.tolist() == [True, False]
    np.testing.assert_allclose(
        loop.final_observation[0, :, Driving.DISTANCE_TO_STOP_LINE], [149 - 51 - 2, 149 - 54.5 - 2], atol=1e-4
    )
    return loop


def test_without_autoreset_an_ended_world_stays_as_it_is() -> None:
    loop = crash("off")
    np.testing.assert_array_equal(loop.final_observation[0], loop.observation[0])
    before, seen = loop.state(), loop.observation[0].copy()
    assert before["done"].tolist() == [True, False]
    act(loop, np.random.default_rng(0))
    after = loop.state()
    for name in after:
        np.testing.assert_array_equal(after[name][0], before[name][0], err_msg=name)
    np.testing.assert_array_equal(loop.observation[0], seen)
    assert after["cycle"].tolist() == [1, 2]
    assert (after["position"][1] != before["position"][1]).all()
    loop.reset_worlds(np.array([True, False]))
    assert loop.state()["done"].tolist() == [False, False]


def test_with_same_step_an_ended_world_starts_anew_at_once() -> None:
    loop = crash("same_step")
    state = loop.state()
    assert state["cycle"].tolist() == [0, 1]
    assert not state["done"].any()
    twin = twin_of(state, 0)
    assert reference_worlds.violations(twin_map("t_junction"), twin) == []
    seen = reference_worlds.decided(twin_map("t_junction"), twin.traffic, twin.delta, twin.hold, Rules())[1].driving
    np.testing.assert_allclose(loop.observation[0, :, : Driving.ENTERS], seen[:, : Driving.ENTERS], atol=1e-3)
    assert loop.reward[0, 0] < -2500
    act(loop, np.random.default_rng(0))
    assert loop.state()["cycle"].tolist() == [1, 2]


def test_with_next_step_an_ended_world_starts_anew_by_the_next_step_and_ignores_its_action() -> None:
    results = []
    for push in (-1.0, 1.0):
        loop = crash("next_step")
        np.testing.assert_array_equal(loop.final_observation[0], loop.observation[0])
        assert loop.state()["done"].tolist() == [True, False]
        loop.action[:] = push
        loop.step()
        assert (loop.reward[0] == 0).all()
        assert not (loop.terminated[0] | loop.truncated[0] | loop.reinserted[0]).any()
        assert not loop.done[0]
        state = loop.state()
        assert state["cycle"].tolist() == [0, 2]
        assert reference_worlds.violations(twin_map("t_junction"), twin_of(state, 0)) == []
        results.append(loop.observation[0].copy())
    np.testing.assert_array_equal(results[0], results[1])


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
    assert float(loop.final_observation[0, Driving.DISTANCE_TO_STOP_LINE]) == pytest.approx(149 - 53 - 2, abs=1e-3)
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
        assert float(loop.observation[0, Driving.SPEED]) == pytest.approx(5.0, abs=1e-4)
