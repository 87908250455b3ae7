"""Starts of the replay: who acts and from when on, with which memories, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, _core
from intersection_env.features import Driving
from tests.support.recorded_windows import recorded_windows, replayed_windows
from tests.support.replay_by_hand import T, hand
from tests.support.replay_cases import core_of_scenes, driven, scene_of
from tests.support.worlds_cases import rules_and_policy


def test_resets_draw_all_actors_and_nobody_else() -> None:
    windows = recorded_windows()
    actors = windows.able()[::2]
    loop = replayed_windows(30 * len(actors), actors=actors)
    loop.reset(3, False)
    assert set(loop.track.tolist()) == set(actors)
    assert loop.time.tolist() == [windows.track(number).first_recorded for number in loop.track.tolist()]
    before = loop.track.copy()
    mask = np.zeros(len(before), np.bool_)
    mask[::3] = True
    loop.reset_worlds(mask)
    np.testing.assert_array_equal(loop.track[~mask], before[~mask])
    assert (loop.track[mask] != before[mask]).mean() > 0.5


def test_desynchronised_worlds_begin_anywhere_within_their_tracks() -> None:
    windows = recorded_windows()
    loop = replayed_windows(400, actors=windows.able())
    loop.reset(3, True)
    state, share = loop.state(), []
    for world in range(400):
        one, time = windows.track(int(loop.track[world])), int(loop.time[world])
        assert one.first_recorded <= time < one.stop - 1
        assert float(state["position"][world]) == pytest.approx(one.position[time - one.start], abs=1e-4)
        share += (
            [(time - one.first_recorded) / (one.stop - 2 - one.first_recorded)]
            if one.stop - one.first_recorded > 30
            else []
        )
    assert 0.35 < np.mean(share) < 0.65
    assert min(share) < 0.1
    assert max(share) > 0.9


def test_acting_vehicle_begins_at_its_first_recorded_step() -> None:
    """Not where it was extrapolated to."""
    track = driven(T, "W-E", 30.0, 5.0, start=2)
    observed = track.observed.copy()
    observed[:7] = False
    loop = hand(replace(track, observed=observed))
    assert int(loop.time[0]) == 9
    assert float(loop.observation[0, Driving.DISTANCE_TO_STOP_LINE]) == pytest.approx(149 - 30 - 7 - 2, abs=1e-3)


def test_memory_at_the_start_is_the_models() -> None:
    """Recorded as second, and standing: at 4 m/s, it has to wait if it can still stop within 2 m, else has entered."""
    for before, enters in ((0.5, True), (30.0, False)):
        actor = driven(T, "S-W", 97.1019404 - 2 - before, 4.0)
        foe = driven(T, "W-E", 155.785958 - 2 - 10.0, 10.0)
        standing = replace(actor, position=actor.position[0] + np.zeros(60))  # as second; its speed is kept
        loop = hand(standing, foe)
        assert bool(loop.observation[0, Driving.ENTERS]) == enters


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
