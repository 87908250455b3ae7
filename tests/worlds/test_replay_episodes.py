"""The replay by hand: kinematics, reward, who is there, and how an episode ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env.features import Driving
from tests.support.replay_by_hand import T, column, go, hand
from tests.support.replay_cases import driven, replay, scene_of


def test_kinematics_never_go_backwards() -> None:
    loop = hand(driven(T, "W-E", 50.0, 1.0))
    seen = go(loop, 2, -6.0)
    np.testing.assert_allclose(column(seen, Driving.SPEED), [0.0, 0.0], atol=1e-6)
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
    assert float(loop.final_observation[0, Driving.DISTANCE_TO_STOP_LINE]) == pytest.approx(149 - 60 - 2, abs=1e-3)


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
    assert float(loop.final_observation[0, Driving.LEAD_DISTANCE]) == 100.0
    assert float(last["reward"][0]) > -200


def test_vehicles_come_and_go() -> None:
    """A lead is there from its first recorded step to its last."""
    loop = hand(driven(T, "W-E", 30.0, 5.0), driven(T, "W-E", 60.0, 5.0, start=5, steps=10))
    seen = go(loop, 30)
    there = [5 <= time < 15 for time in range(1, len(seen) + 1)]
    np.testing.assert_array_equal(column(seen, Driving.LEAD_DISTANCE) < 100, there)
