"""The replay by hand: who may lead the acting vehicle is who was ahead of it in the recording."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env.features import Driving
from tests.support.replay_by_hand import T, column, go, hand
from tests.support.replay_cases import driven


def test_vehicle_that_was_behind_never_becomes_the_lead() -> None:
    """Also once it has driven through the acting one, which stops in its way; and that is nobody's fault here."""
    loop = hand(driven(T, "W-E", 50.0, 10.0), driven(T, "W-E", 30.0, 10.0))
    seen = go(loop, 40, -5.0)
    assert len(seen) == 40
    np.testing.assert_array_equal(column(seen, Driving.LEAD_DISTANCE), 100.0)
    assert not any(one["terminated"][0] for one in seen)


def test_vehicle_that_was_ahead_leads_and_may_not_be_hit() -> None:
    loop = hand(driven(T, "W-E", 30.0, 10.0), driven(T, "W-E", 50.0, 10.0))
    seen = go(loop, 40, 2.0)
    time = 0.2 * np.arange(1, len(seen) + 1)
    np.testing.assert_allclose(column(seen, Driving.LEAD_DISTANCE), 20 - 4 - time**2, atol=1e-3)
    np.testing.assert_allclose(column(seen, Driving.LEAD_SPEED), 10.0, atol=1e-5)
    assert seen[-1]["terminated"][0]
    assert seen[-1]["reward"][0] < -4000


def test_lead_order_before_a_split_is_that_of_the_first_moment_both_are_there() -> None:
    """The one on W-S was ahead when the other appeared, and only then was overtaken in the recording."""
    slow = driven(T, "W-S", 60.0, 0.5)
    for actor, other, leads in ((slow, False, False), (driven(T, "W-E", 30.0, 10.0), True, True)):
        second = slow if other else driven(T, "W-E", 30.0, 10.0)
        seen = go(hand(actor, second), 3, -0.1)
        assert (column(seen, Driving.LEAD_DISTANCE) < 100).all() == leads


@pytest.mark.parametrize(("ahead", "leads"), [(4.5, True), (-4.5, False)])
def test_lead_order_beyond_a_merge_is_who_reached_it_first(ahead: float, leads: bool) -> None:
    """S-E and W-E merge at 101 and 165 m: positions on W-E are 64.0820762 m more."""
    other = driven(T, "W-E", 120.0 + 64.0820762 - 40 + ahead, 10.0)
    actor = driven(T, "S-E", 120.0 - 40, 10.0)
    loop = hand(actor, other)
    seen = go(loop, 45, -0.5)
    beyond = np.array([float(one["observation"][0, Driving.DISTANCE_TO_STOP_LINE]) for one in seen]) < -10
    assert beyond.any()
    assert (column(seen, Driving.LEAD_DISTANCE)[beyond] < 100).any() == leads
    assert not any(one["terminated"][0] for one in seen[:25])


@pytest.mark.parametrize(("ahead", "leads"), [(15.0, True), (-15.0, False)])
def test_of_two_beyond_a_merge_when_the_scene_begins_the_one_ahead_leads(ahead: float, leads: bool) -> None:
    """Nothing tells who reached it first."""
    loop = hand(driven(T, "S-E", 120.0, 8.0), driven(T, "W-E", 120.0 + 64.0820762 + ahead, 8.0))
    assert float(loop.observation[0, Driving.LEAD_DISTANCE]) == pytest.approx(15.0 - 4 if leads else 100.0, abs=1e-3)
