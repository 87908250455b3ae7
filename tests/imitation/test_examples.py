"""What predictions should come to: recorded moments as they are, and free drives only where nobody is recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from imitation.examples import Example, free_examples, recorded_examples, teacher_named
from imitation.expert import expert_steps
from imitation.tracks import replays
from intersection_env import Intersection, Predictor, Scenes
from intersection_env.evaluation.empty_road import free_drive
from intersection_env.evaluation.moments import SCORED, moments_of
from intersection_env.features import Driving
from intersection_env.scenes.scene import Track
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


def test_free_drives_end_about_as_fast_as_recorded_drivers_or_the_teacher(scenes: Scenes, free: list[Example]) -> None:
    """In view as fast as some recorded drivers on a free road, beyond it as the teacher in its free drive."""
    steps, tracks = expert_steps(scenes, None), replays(scenes, None).tracks.arrays
    seen, route_of = steps.observation, tracks["track_route"][steps.track]
    is_free = (seen[:, Driving.ENTERS] > 0.0) & (seen[:, Driving.LEAD_DISTANCE] > 40.0)
    teacher = Predictor.load("idm_calibrated")
    shares: dict[str, list[float]] = {"in view": [], "beyond": []}
    for one in free:
        route = scenes.intersection.routes[int(one.traffic.route[0])]
        last = np.flatnonzero(one.scored[:, 0])[-1]
        to_line = route.stop_line - float(one.position[last, 0]) - 2.25
        near = is_free & (route_of == route.index) & (np.abs(seen[:, Driving.DISTANCE_TO_STOP_LINE] - to_line) < 1.0)
        if near.sum() >= 20 and to_line > 10.0:
            shares["in view"].append(float(one.speed[last, 0]) / float(np.quantile(seen[near, Driving.SPEED], 0.75)))
        elif not near.any() and last == 50:
            places, speeds = free_drive(teacher, scenes.intersection, route)
            shares["beyond"].append(float(one.speed[last, 0]) / float(np.interp(one.position[last, 0], places, speeds)))
    for ratios in shares.values():
        assert len(ratios) >= 10
        assert 0.9 < float(np.median(ratios)) < 1.1


def test_one_free_drive_in_five_begins_at_a_standstill_and_none_too_fast(scenes: Scenes, free: list[Example]) -> None:
    speed = np.array([one.traffic.speed[0] for one in free])
    assert 0.1 < float((speed == 0.0).mean()) < 0.3
    assert float(speed.max()) <= max(float(route.samples[:, 4].max()) for route in scenes.intersection.routes)


def test_nobody_stands_for_long_in_a_free_drive(free: list[Example]) -> None:
    for one in free:
        known = one.scored[:, 0]
        assert bool((np.diff(one.position[known, 0]) >= 0.0).all())
        assert bool((one.speed[15:, 0] > 2.0).all())


def test_free_drives_are_drawn_by_the_generator(scenes: Scenes, free: list[Example]) -> None:
    teacher = Predictor.load("idm_calibrated")
    same, other = (free_examples([scenes], teacher, 3, np.random.default_rng(seed)) for seed in (0, 1))
    np.testing.assert_array_equal(same[0].position, free[0].position)
    assert float(other[0].position[0, 0]) != float(free[0].position[0, 0])


def test_a_teacher_drives_by_the_idm() -> None:
    assert teacher_named("idm_calibrated").policy.driver == "idm"
    with pytest.raises(ValueError, match='teacher: "gail" drives by "network"'):
        teacher_named("gail")


def test_roads_on_which_nobody_is_recorded_are_driven_as_the_teacher_drives_them() -> None:
    intersection, teacher = Intersection.load("roundabout"), Predictor.load("idm_calibrated")
    roads = Scenes(intersection, (), {}, {})
    free = free_examples([roads], teacher, 100, np.random.default_rng(0))
    assert len({int(one.traffic.route[0]) for one in free}) == len(intersection.routes)
    shares = []
    for one in free:
        if one.scored[-1, 0]:
            places, speeds = free_drive(teacher, intersection, intersection.routes[int(one.traffic.route[0])])
            shares.append(float(one.speed[-1, 0]) / float(np.interp(one.position[-1, 0], places, speeds)))
    assert len(shares) > 20
    assert 0.9 < float(np.median(shares)) < 1.1


def test_who_stands_on_a_free_road_teaches_nobody_to_stand(scenes: Scenes) -> None:
    """A car that stays for a minute where others drive by, as one that is parked or broken down."""
    scene = max(scenes.scenes, key=lambda one: one.steps)
    way, steps = scenes.intersection.routes[0], 300
    still = np.zeros(steps, np.float32)
    place = np.full(steps, way.junction[1] - 3.0, np.float32)
    parked = Track("99/0", "car", 0, 4.5, 1.8, 0, place, still, still, np.ones(steps, np.bool_))
    alone = replace(scene, steps=steps, tracks=(parked,))
    stands = replace(scenes, scenes=(alone,))
    free = free_examples([stands], Predictor.load("idm_calibrated"), 60, np.random.default_rng(0))
    assert all(float(one.speed[15:, 0].min()) > 2.0 for one in free)
