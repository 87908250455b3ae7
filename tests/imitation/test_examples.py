"""What predictions should come to: recorded moments as they are, and free drives only where nobody is recorded."""

from __future__ import annotations

import numpy as np
import pytest

from imitation.examples import Example, free_examples, recorded_examples
from imitation.expert import expert_steps
from imitation.tracks import replays
from intersection_env import Predictor, Scenes
from intersection_env.evaluation.moments import SCORED, moments_of
from intersection_env.features import Driving
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return Scenes.load("t_junction").select("train")


@pytest.fixture(scope="module")
def free(scenes: Scenes) -> list[Example]:
    return free_examples([scenes], Predictor.load("idm_calibrated"), 200, np.random.default_rng(0))


def test_recorded_examples_hold_what_became_of_a_moment() -> None:
    moments = moments_of(small_scenes("train"), every=10.0)[0]
    assert len(moments) > 5
    for moment, one in zip(moments, recorded_examples(moments), strict=True):
        known = ~np.ma.getmaskarray(moment.recorded)
        np.testing.assert_array_equal(one.position[known], moment.recorded.data[known])
        np.testing.assert_array_equal(one.speed[0], moment.traffic.speed)
        for i, track in enumerate(moment.tracks()):
            steps = int(one.scored[:, i].sum())
            assert steps == 0 or track.road_user in SCORED
            assert not one.scored[:, i].any() or known[0, i], "who is not recorded now does not count"
            np.testing.assert_array_equal(one.scored[:, i] & ~known[:, i], False)
            end = moment.future(track)
            np.testing.assert_array_equal(one.speed[: len(track.speed[end]), i], track.speed[end])


def test_free_drives_count_where_nobody_is_recorded_or_nobody_is_as_slow(scenes: Scenes, free: list[Example]) -> None:
    """Beyond the view all of them; within it fewer, and more slowly than nearly all who drive freely there."""
    steps, tracks = expert_steps(scenes, None), replays(scenes, None).tracks.arrays
    place = tracks["track_route"][steps.track], steps.observation[:, Driving.DISTANCE_TO_STOP_LINE]
    is_free = (steps.observation[:, Driving.ENTERS] > 0.0) & (steps.observation[:, Driving.LEAD_DISTANCE] > 40.0)
    beyond, slower = 0, []
    for one in free:
        route = scenes.intersection.routes[int(one.traffic.route[0])]
        to_line = route.stop_line - one.position[:, 0] - 2.25
        for k in np.flatnonzero(one.scored[:, 0])[::3]:
            near = is_free & (place[0] == route.index) & (np.abs(place[1] - to_line[k]) < 1.0)
            beyond += int(near.sum() == 0)
            if near.sum() >= 20:
                slower.append(float((steps.observation[near, Driving.SPEED] < one.speed[k, 0]).mean()))
        ends = (to_line < -80.0) | (to_line > 60.0)
        assert bool(one.scored[ends & (np.arange(51) < one.scored.nonzero()[0].max()), 0].all())
    assert beyond > 30
    assert len(slower) > 10
    assert np.mean(slower) < 0.1


def test_one_free_drive_in_five_begins_at_a_standstill_and_none_too_fast(scenes: Scenes, free: list[Example]) -> None:
    speed = np.array([one.traffic.speed[0] for one in free])
    assert 0.1 < float((speed == 0.0).mean()) < 0.3
    assert float(speed.max()) <= max(float(route.samples[:, 4].max()) for route in scenes.intersection.routes)


def test_free_drives_are_the_teachers(scenes: Scenes, free: list[Example]) -> None:
    teacher = Predictor.load("idm_calibrated")
    for one in free[:10]:
        np.testing.assert_array_equal(one.position, teacher.predict(one.traffic).position[0])
    others = free_examples([scenes], teacher, 3, np.random.default_rng(1))
    assert float(others[0].position[0, 0]) != float(free[0].position[0, 0])
