"""The rules and models beside the gap network."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.gap.baselines import BASELINES, nearest_foes, sumo_accepts
from intersection_env.features import Gap
from tests.support.gap_samples import CAR, gap_samples_of, planted

PROBABLE = ("logistic", "boosting", "boosting_three")


def pair(
    to_stop: float, to_pga: float, speed: float, foe_to_stop: float, foe_speed: float, foe_to_leave: float, merging: int
) -> NDArray[np.bool_]:
    """What the kinematic rule says of one pair with v_max 10 m/s for the yielder and 14 m/s for the foe."""
    kinematics = (to_stop, 10.0, 14.0, foe_to_leave, merging, CAR)
    return sumo_accepts(gap_samples_of((to_pga, speed, foe_to_stop, foe_speed), [1], kinematics=kinematics))


def test_always_wait_is_right_where_the_yielder_came_later() -> None:
    samples = planted(200)
    decided = BASELINES["always_wait"](samples).decide(samples)
    assert not decided.any()
    assert (decided == samples.labels()).mean() == (~samples.labels()).mean()


def test_rules_of_the_core_are_taken_as_they_are() -> None:
    samples = planted(20)
    assert not BASELINES["critical_gap"](samples).decide(samples).any()
    assert BASELINES["sumo"](samples).decide(samples).all()
    assert BASELINES["sumo"](samples).probability(samples) is None


@pytest.mark.parametrize("name", PROBABLE)
def test_planted_rule_is_learned(name: str) -> None:
    train, test = planted(2000), planted(500, seed=1)
    decider = BASELINES[name](train)
    probability = decider.probability(test)
    assert probability is not None
    assert (decider.decide(test) == test.labels()).mean() > 0.97
    np.testing.assert_array_equal(decider.decide(test), probability > 0.5)


@pytest.mark.parametrize("name", ["logistic", "boosting"])
def test_pairs_of_unknown_order_do_not_teach(name: str) -> None:
    train = planted(300)
    more = gap_samples_of(
        np.concatenate([train.features, train.features]),
        np.concatenate([train.first, np.full(len(train.first), -1)]),
        np.concatenate([train.sample, train.sample + len(train)]),
    )
    expected, found = (BASELINES[name](one).probability(train) for one in (train, more))
    np.testing.assert_array_equal(expected, found)


@pytest.mark.parametrize("name", ["logistic", "boosting"])
def test_most_doubtful_foe_decides(name: str) -> None:
    decider = BASELINES[name](planted(2000))
    near, far = (12.0, 3.0, 10.0, 10.0), (12.0, 3.0, 90.0, 10.0)
    both = gap_samples_of([far, near], [1, 0], sample=[0, 0])
    alone = gap_samples_of([near], [0])
    assert decider.probability(both) == pytest.approx(decider.probability(alone))
    assert not decider.decide(both).any()
    assert decider.accepts(both) == pytest.approx([True, False])


def test_three_nearest_foes_come_in_order_and_missing_ones_are_nan() -> None:
    at = [30.0, -2.0, 80.0, 10.0, 55.0]
    samples = gap_samples_of([(1.0, 2.0, d, 4.0) for d in at], [0] * 5, sample=[0, 0, 0, 0, 1])
    nearest = nearest_foes(samples).reshape(2, 3, len(Gap))
    np.testing.assert_array_equal(nearest[0, :, Gap.FOE_DISTANCE_TO_STOP_LINE], [-2.0, 10.0, 30.0])
    np.testing.assert_array_equal(nearest[1, 0], [1.0, 2.0, 55.0, 4.0])
    assert np.isnan(nearest[1, 1:]).all()


def test_standing_yielder_needs_the_time_to_accelerate_through_the_conflict_and_a_second() -> None:
    # From a stand at the line: sqrt(2 * 2.6 * 13) = 8.22 m/s after 13 m, so 13 / 4.11 = 3.16 s by SUMO's mean speed;
    # a foe at 14 m/s must be more than 4.16 s = 58.3 m away.
    assert not pair(0.0, 13.0, 0.0, 58.0, 14.0, 75.0, merging=0)
    assert pair(0.0, 13.0, 0.0, 58.6, 14.0, 75.0, merging=0)


def test_slower_foe_accelerates_to_its_speed_limit() -> None:
    # From 10 to 14 m/s in 1.54 s and 18.5 m; with 40.9 m left at 14 m/s: 4.16 s to 55.2 m.
    assert not pair(0.0, 13.0, 0.0, 55.0, 10.0, 75.0, merging=0)
    assert pair(0.0, 13.0, 0.0, 55.6, 10.0, 75.0, merging=0)


def test_yielder_may_follow_a_foe_that_has_left_the_conflict_before_it_arrives() -> None:
    # 28 m at 10 m/s take 2.8 s; the foe at 14 m/s is out after 2.79 s or 2.81 s.
    assert pair(28.0, 41.0, 10.0, 20.0, 14.0, 39.0, merging=0)
    assert not pair(28.0, 41.0, 10.0, 20.0, 14.0, 39.4, merging=0)


def test_merging_follower_keeps_a_second() -> None:
    assert not pair(28.0, 41.0, 10.0, 20.0, 14.0, 39.0, merging=1)
    assert pair(28.0, 41.0, 10.0, 8.0, 14.0, 25.0, merging=1)  # out after 1.79 s


def test_merging_leader_must_be_fast_enough_for_a_foe_that_cannot_brake() -> None:
    # The foe comes at 14 m/s from 15 m: after a second's reaction it is at 13.7 m/s at the line, so it cannot fall
    # behind a yielder that leaves at 10 m/s, however soon that is; one that can stop does not matter.
    arguments = (0.0, 0.1, 10.0)
    assert pair(*arguments, 15.0, 14.0, 30.0, merging=0)
    assert not pair(*arguments, 15.0, 14.0, 30.0, merging=1)
    assert pair(*arguments, 60.0, 14.0, 75.0, merging=1)


def test_foe_beyond_its_stop_line_is_waited_for_until_it_has_left() -> None:
    assert not pair(5.0, 18.0, 5.0, -3.0, 5.0, 12.0, merging=0)
    assert pair(30.0, 43.0, 5.0, -3.0, 5.0, 12.0, merging=0)
