"""The replay by hand: who enters, and who is to blame for a collision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env.features import Driving
from tests.reference.worlds import Track
from tests.support.replay_by_hand import T, column, foe_passing, go, hand, yielding
from tests.support.replay_cases import driven
from tests.support.twins import twin_map


def test_recording_decides_as_the_recorded_vehicle_did() -> None:
    """First at the conflict: it may enter at once, though the gap is small; second: when the other is through."""
    first = go(hand(yielding(3.05), foe_passing(4.05)), 30)
    assert column(first, Driving.ENTERS).all()
    second = go(hand(yielding(5.05), foe_passing(2.05)), 30, -0.5)
    passed = np.array([155.785958 - 2 - 20.5 + 2.0 * k for k in range(1, len(second) + 1)]) >= 160.716451
    np.testing.assert_array_equal(column(second, Driving.ENTERS), passed)
    assert passed.any()


def test_policy_decides_whatever_the_recorded_vehicle_did() -> None:
    early = column(go(hand(yielding(3.05), foe_passing(4.05), decisions="critical_gap"), 5, -1.0), Driving.ENTERS)
    assert not early.any()
    alone = column(go(hand(yielding(3.05), decisions="critical_gap"), 5, -1.0), Driving.ENTERS)
    assert alone.all()


def test_who_reaches_a_conflict_within_one_step_of_the_other_was_second() -> None:
    """And so was who never reached it, though the other did not either."""
    tie = go(hand(yielding(3.05), foe_passing(3.05)), 5, -1.0)
    assert not column(tie, Driving.ENTERS).any()
    neither = [replace_steps(one, 8) for one in (yielding(4.05), foe_passing(4.05))]
    assert not column(go(hand(*neither), 5, -1.0), Driving.ENTERS).any()


def replace_steps(track: Track, steps: int) -> Track:
    arrays = {name: getattr(track, name)[:steps] for name in ("position", "speed", "observed")}
    return replace(track, **arrays)


@pytest.mark.parametrize("waited", [True, False])
def test_recorded_vehicle_that_was_held_does_not_hold_the_acting_one(waited: bool) -> None:
    """NE-SE yields to SW-NE, which stands at its line and yielded, or not, to SE-NW, more than 6 s away."""
    name = "bendplatz"
    route = {one.id: one for one in twin_map(name).routes}
    foe = driven(name, "SW-NE", route["SW-NE"].stop_line - 3, [0.0] * 10 + [5.0 if not waited else 0.0] * 50)
    far = driven(name, "SE-NW", route["SE-NW"].stop_line - 2 - 80, 10.0)
    actor = driven(name, "NE-SE", route["NE-SE"].stop_line - 4, 0.0)  # it has made its stop
    seen = go(hand(actor, foe, far, decisions="critical_gap", name=name), 4)
    assert column(seen, Driving.ENTERS).tolist() == [float(waited)] * 4


def stopping(speeds: list[float]) -> Track:
    """A vehicle that comes to its stop sign, alone, from 10 m before its line."""
    route = {one.id: one for one in twin_map("bendplatz").routes}["NE-SE"]
    return driven("bendplatz", "NE-SE", route.stop_line - 12, speeds, len(speeds))


def test_recording_asks_for_a_stop_that_was_made_until_it_is_made() -> None:
    """So of the recorded vehicle as it was, and of the acting one, which drives faster and stops later or never."""
    track = stopping([*[4.0] * 9, 3.0, 2.0, 1.0, 0.3, 0.0, 0.0, 1.0, *[2.0] * 20])
    seen = go(hand(track, name="bendplatz"), 30, 1.0)
    to_line = np.array([one["expert_observation"][0, Driving.DISTANCE_TO_STOP_LINE] for one in seen])
    speed = np.array([one["expert_observation"][0, Driving.SPEED] for one in seen])
    stands = int(np.flatnonzero((speed < 0.5) & (to_line < 3.0))[0])
    expert = np.array([one["expert_observation"][0, Driving.ENTERS] for one in seen])
    np.testing.assert_array_equal(expert, np.arange(len(seen)) >= stands)
    assert 8 < stands < 14
    own = np.array([one["observation"][0] for one in seen])
    held = (own[:, Driving.DISTANCE_TO_STOP_LINE] >= 0.0) & (own[:, Driving.SPEED] ** 2 / 8.0 < own[:, 0])
    assert held.sum() > 3
    assert not own[held, Driving.ENTERS].any()


@pytest.mark.parametrize(
    ("speeds", "asked"),
    [([3.0] * 30, False), ([3.0] * 10, True), ([3.0] * 19 + [0.0] * 8, False)],
    ids=["passes without", "is recorded before its line alone", "stands beyond its line"],
)
def test_recording_asks_for_no_stop_of_who_passed_its_line_without(speeds: list[float], asked: bool) -> None:
    seen = go(hand(stopping(speeds), name="bendplatz"), 5, 0.0)
    for door in ("observation", "expert_observation"):
        assert [bool(one[door][0, Driving.ENTERS]) for one in seen] == [not asked] * 5


# Blame


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
