"""The reward, row by row of the paper's Table II, and who is to blame for a collision: by hand, through the core.

All on the T-junction: W-E and E-W are the main road (v_max 50 km/h, stop lines at 149 and 153.5 m), S-W and S-E yield
(v_max 30 km/h on the approach, stop lines at 97.1019404 and 97.200677 m). Vehicles are 4 m by 2 m.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from intersection_env.features import Driving
from tests.support.worlds_cases import Placed, rewards

TOWN = 50 / 3.6  # m/s, v_max of the main road
SIDE = 30 / 3.6  # m/s, v_max of the minor arm before the junction
LINE = 97.1019404  # m, stop line of S-W
PGA = 104.458535  # m, where S-W ends its conflict with W-E
BLAME = 5000.0


def reward_of(*vehicles: Placed) -> list[float]:
    return [float(one) for one in rewards("t_junction", *vehicles)["reward"]]


def refused(front_before_line: float, speed: float, acceleration: float = 0.0, delta: bool = False) -> list[Placed]:
    """A vehicle on S-W, this far before its line, and one on W-E, 5 s before its own: less than the critical 6 s."""
    yielder = Placed("S-W", LINE - front_before_line - 2, speed, acceleration, delta=delta)
    return [yielder, Placed("W-E", 149 - 2 - 5 * TOWN, TOWN)]


def test_vehicle_at_the_limit_on_an_empty_road_gets_two() -> None:
    assert reward_of(Placed("W-E", 50.0, TOWN)) == pytest.approx([2.0], abs=1e-3)


@pytest.mark.parametrize("acceleration", [1.2, -2.4])
def test_acceleration_costs_a_hundredth_of_its_square(acceleration: float) -> None:
    assert reward_of(Placed("W-E", 50.0, TOWN, acceleration)) == pytest.approx([2 - 0.01 * acceleration**2], abs=1e-3)


@pytest.mark.parametrize("acceleration", [2.6, -2.6, 3.9])
def test_acceleration_above_comfort_costs_one_more(acceleration: float) -> None:
    by_hand = 2 - 0.01 * acceleration**2 - 1
    assert reward_of(Placed("W-E", 50.0, TOWN, acceleration)) == pytest.approx([by_hand], abs=1e-3)


@pytest.mark.parametrize("acceleration", [4.1, -4.1, -6.0])
def test_hard_acceleration_costs_twenty_more(acceleration: float) -> None:
    by_hand = 2 - 0.01 * acceleration**2 - 1 - 20
    assert reward_of(Placed("W-E", 50.0, TOWN, acceleration)) == pytest.approx([by_hand], abs=1e-3)


@pytest.mark.parametrize("speed", [0.0, 5.0, 13.0])
def test_free_vehicle_slower_than_the_limit_pays_for_it(speed: float) -> None:
    by_hand = 2 - 20 / TOWN * (TOWN - speed)  # sqrt(2 * 100) = 14.1 m/s is above the limit
    assert reward_of(Placed("W-E", 50.0, speed)) == pytest.approx([by_hand], abs=1e-3)


def test_slowness_is_measured_by_the_vehicles_own_top_speed() -> None:
    assert reward_of(Placed("W-E", 50.0, 2.0, max_speed=5.0)) == pytest.approx([2 - 20 / 5 * (5 - 2)], abs=1e-3)


def test_vehicle_behind_a_lead_may_be_slow() -> None:
    gap = 8.0  # v_min = sqrt(2 * 1 * 8) = 4 m/s
    vehicles = [Placed("W-E", 50.0, 3.0), Placed("W-E", 50.0 + 4 + gap, TOWN)]
    assert reward_of(*vehicles)[0] == pytest.approx(2 - 20 / TOWN * (4 - 3), abs=1e-3)


def test_vehicle_that_must_wait_may_be_slow_before_its_line() -> None:
    # v_min = sqrt(2 * 1 * 2) = 2 m/s; it brakes within 1 / 8 m
    assert reward_of(*refused(2.0, 1.0))[0] == pytest.approx(2 - 20 / SIDE * (2 - 1), abs=1e-3)


def test_vehicle_that_may_enter_may_not_be_slow_before_its_line() -> None:
    alone = refused(2.0, 1.0)[0]
    assert reward_of(alone) == pytest.approx([2 - 20 / SIDE * (SIDE - 1)], abs=1e-3)


def test_vehicle_standing_past_its_line_need_not_move() -> None:
    """Where d_stop is negative, v_min is 0 and no root of a negative number."""
    assert reward_of(*refused(-0.5, 0.0))[0] == pytest.approx(2 - 30 * (0 + 0.5), abs=1e-3)


def test_vehicle_standing_inside_its_lead_need_not_move() -> None:
    vehicles = [Placed("W-E", 50.0, 0.0), Placed("W-E", 53.5, 0.0)]
    assert reward_of(*vehicles)[0] == pytest.approx(2 - 30 * 0.5 - BLAME, abs=1e-2)


@pytest.mark.parametrize("too_fast", [0.5, 4.0])
def test_vehicle_above_the_limit_pays_for_it(too_fast: float) -> None:
    assert reward_of(Placed("W-E", 50.0, TOWN + too_fast)) == pytest.approx([2 - 30 / TOWN * too_fast], abs=1e-3)


def test_vehicle_above_its_own_top_speed_pays_for_it() -> None:
    assert reward_of(Placed("W-E", 50.0, 6.0, max_speed=5.0)) == pytest.approx([2 - 30 / 5 * (6 - 5)], abs=1e-3)


def test_vehicle_driving_backwards_pays_for_it() -> None:
    by_hand = 2 - 20 / TOWN * (TOWN + 0.5) - 30 * 0.5  # and does not brake: s_brake is 0
    assert reward_of(Placed("W-E", 50.0, -0.5)) == pytest.approx([by_hand], abs=1e-3)


def test_vehicle_driving_backwards_does_not_brake() -> None:
    vehicles = [Placed("W-E", 50.0, -4.0), Placed("W-E", 50.0 + 4 + 1, TOWN)]
    by_hand = 2 - 20 / TOWN * (math.sqrt(2) + 4) - 30 * 4  # 4²/8 = 2 m of braking would reach the lead, 1 m ahead
    assert reward_of(*vehicles)[0] == pytest.approx(by_hand, abs=1e-2)


def test_vehicle_that_could_not_brake_before_its_lead_pays_for_it() -> None:
    vehicles = [Placed("W-E", 50.0, 10.0), Placed("W-E", 50.0 + 4 + 11, 10.0)]
    assert reward_of(*vehicles)[0] == pytest.approx(2 - 30 * (10**2 / 8 - 11), abs=1e-2)


def test_vehicle_that_must_wait_and_cannot_brake_before_its_line_pays_for_it() -> None:
    assert reward_of(*refused(5.0, 8.0))[0] == pytest.approx(2 - 30 * (8**2 / 8 - 5), abs=1e-2)


def test_vehicle_that_had_entered_and_cannot_brake_before_its_line_pays_nothing() -> None:
    assert reward_of(*refused(5.0, SIDE, delta=True))[0] == pytest.approx(2.0, abs=1e-2)


def test_penalties_add_up() -> None:
    """Every row but backwards and collision at once: past the limit, too near the line, hard acceleration."""
    speed, acceleration = SIDE + 1, 4.5
    by_hand = 2 - 0.01 * acceleration**2 - 1 - 20 - 30 / SIDE * 1 - 30 * (speed**2 / 8 - 5)
    assert reward_of(*refused(5.0, speed, acceleration))[0] == pytest.approx(by_hand, abs=1e-2)


# Blame


def outcome(*vehicles: Placed) -> tuple[list[bool], list[bool], list[bool]]:
    """Who pays for a collision, who is terminated, who is truncated."""
    seen = rewards("t_junction", *vehicles)
    assert bool(seen["done"]) == bool((seen["terminated"] | seen["truncated"]).any())
    assert not seen["reinserted"].any()
    return (seen["reward"] < -BLAME / 2).tolist(), seen["terminated"].tolist(), seen["truncated"].tolist()


NOBODY = ([False, False], [False, False], [False, False])
FIRST = ([True, False], [True, False], [False, True])
SECOND = ([False, True], [False, True], [True, False])
BOTH = ([True, True], [True, True], [False, False])


@pytest.mark.parametrize(("gap", "expected"), [(0.45, FIRST), (0.55, NOBODY)])
def test_bodies_collide_nearer_than_half_a_metre(gap: float, expected: object) -> None:
    """Circles of 1 m radius at ±1 m: between two cars in line, the circles are as far apart as the bumpers."""
    assert outcome(Placed("W-E", 50.0, 0.0), Placed("W-E", 54.0 + gap, 0.0)) == expected


@pytest.mark.parametrize("order", [1, -1])
def test_the_one_behind_in_the_lane_is_to_blame(order: int) -> None:
    vehicles = [Placed("W-E", 50.0, 5.0), Placed("W-E", 54.2, 5.0)][::order]
    assert outcome(*vehicles) == (FIRST if order == 1 else SECOND)


@pytest.mark.parametrize(("lead_speed", "expected"), [(10.0, NOBODY), (4.0, FIRST)])
def test_vehicles_that_would_touch_after_braking_collide(lead_speed: float, expected: object) -> None:
    """Both 8 m apart: braking takes the rear one 12.5 m, the other 12.5 or 2 m."""
    assert outcome(Placed("W-E", 50.0, 10.0), Placed("W-E", 62.0, lead_speed)) == expected


def test_a_vehicle_that_would_brake_through_another_does_not_collide() -> None:
    """As the paper tests it: where both end, not on the way."""
    assert outcome(Placed("W-E", 50.0, TOWN), Placed("W-E", 60.0, 0.0)) == NOBODY


def test_the_one_behind_before_the_split_is_to_blame() -> None:
    assert outcome(Placed("W-S", 100.0, 0.0), Placed("W-E", 104.2, 0.0)) == FIRST
    assert outcome(Placed("W-S", 104.2, 0.0), Placed("W-E", 100.0, 0.0)) == SECOND


def test_the_one_behind_beyond_the_merge_is_to_blame() -> None:
    """S-E and W-E merge at 101 and 165 m; positions on W-E are 64.0820762 m more."""
    assert outcome(Placed("S-E", 120.0, 0.0), Placed("W-E", 184.0820762 + 4.2, 0.0)) == FIRST
    assert outcome(Placed("S-E", 120.0, 0.0), Placed("W-E", 184.0820762 - 4.2, 0.0)) == SECOND


def test_two_at_the_same_place_are_both_to_blame() -> None:
    assert outcome(Placed("W-E", 50.0, 0.0), Placed("W-E", 50.0, 0.0)) == BOTH
    assert outcome(Placed("W-S", 50.0, 0.0), Placed("W-E", 50.0, 0.0)) == BOTH


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_the_yielder_is_to_blame_in_a_crossing_conflict(speed: float) -> None:
    """S-W meets W-E at 102 and 158.25 m; also where the other runs into it."""
    assert outcome(Placed("S-W", 102.0, 0.0), Placed("W-E", 158.25, speed)) == FIRST
    assert outcome(Placed("W-E", 158.25, speed), Placed("S-W", 102.0, 0.0)) == SECOND


def test_the_yielder_is_to_blame_before_its_point_of_guaranteed_arrival_though_it_is_ahead() -> None:
    """S-E's rear at 100.9 m is before its PGA, 101 m, and its front beyond the merge, so it leads W-E."""
    yielder, other = Placed("S-E", 102.9, 0.0), Placed("W-E", 102.9 + 64.0820762 - 4.2, 0.0)
    assert outcome(yielder, other) == FIRST
    past = [Placed(one.route, one.position + 0.2, 0.0) for one in (yielder, other)]
    assert outcome(*past) == SECOND


def test_vehicles_on_routes_that_do_not_overlap_never_collide() -> None:
    """E-W and W-E pass each other 3.3 m apart, borders 1.3 m; wider ones 0.3 m."""
    assert outcome(Placed("W-E", 100.0, 0.0), Placed("E-W", 220.0, 0.0)) == NOBODY
    wide = [Placed("W-E", 100.0, 0.0, width=3.0), Placed("E-W", 220.0, 0.0, width=3.0)]
    assert outcome(*wide) == NOBODY


def test_blame_costs_once_however_many_are_hit() -> None:
    vehicles = [Placed("W-E", 50.0, 0.0), Placed("W-E", 54.2, 0.0), Placed("W-S", 54.3, 0.0)]
    seen = rewards("t_junction", *vehicles)
    assert seen["terminated"].tolist() == [True, True, False]
    slow = 20 / TOWN * math.sqrt(2 * 0.2)
    assert float(seen["reward"][0]) == pytest.approx(2 - slow - BLAME, abs=1e-2)


# Leaving


def test_vehicle_that_leaves_is_judged_as_if_alone_and_flagged() -> None:
    """With somebody close behind and in front, who are not there for it."""
    vehicles = [Placed("W-E", 320.5, 10.0, 1.0), Placed("W-E", 280.0, 10.0)]
    seen = rewards("t_junction", *vehicles)
    assert float(seen["reward"][0]) == pytest.approx(2 - 0.01 - 20 / TOWN * (TOWN - 10), abs=1e-2)
    assert seen["reinserted"].tolist() == [True, False]
    assert not (seen["terminated"] | seen["truncated"]).any()
    last = seen["final_observation"][0]
    columns = [Driving.SPEED, Driving.LEAD_DISTANCE, Driving.LEAD_SPEED, Driving.ENTERS]
    assert last[columns] == pytest.approx([10.0, 100.0, 100 / 3.6, 1.0], abs=1e-4)
    assert last[Driving.DISTANCE_TO_STOP_LINE] == pytest.approx(149 - 322.5, abs=1e-3)
    assert float(seen["position"][0]) == 0.0


def test_vehicle_that_backs_off_its_route_leaves_too() -> None:
    seen = rewards("t_junction", Placed("W-E", -0.1, -1.0), Placed("S-W", 50.0, SIDE))
    assert float(seen["reward"][0]) == pytest.approx(2 - 20 / TOWN * (TOWN + 1) - 30, abs=1e-2)
    assert seen["reinserted"].tolist() == [True, False]
    assert np.isfinite(seen["observation"]).all()


@pytest.mark.parametrize(("position", "leaves"), [(319.9, False), (320.05, True)])
def test_vehicle_leaves_at_the_end_of_its_route(position: float, leaves: bool) -> None:
    assert bool(rewards("t_junction", Placed("W-E", position, 5.0))["reinserted"][0]) == leaves
