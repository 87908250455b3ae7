"""The twin by hand: gaps, decisions and who is held."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.reference.decide import Gap
from tests.reference.intersection import Map, Sample, sample
from tests.reference.memory import initial_memory
from tests.reference.networks import Network
from tests.reference.pairs import conflicts
from tests.reference.predict import predict
from tests.reference.traffic import braking_distance, distance_to_stop_line
from tests.support.placing import BENDPLATZ, BOTH, T_JUNCTION, place
from tests.support.random_traffic import random_traffic


@pytest.mark.parametrize(("seconds", "enters"), [(5.9, False), (6.1, True)])
def test_crossing_gap_is_accepted_beyond_six_seconds(seconds: float, enters: bool) -> None:
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("W-E", 10 * seconds, 10))
    assert conflicts(T_JUNCTION, traffic).tolist() == [[0, 1]]
    assert predict(T_JUNCTION, traffic, steps=1).enters[0].tolist() == [enters, True]


@pytest.mark.parametrize(("seconds", "enters"), [(3.9, False), (4.1, True)])
def test_merging_gap_is_accepted_beyond_four_seconds(seconds: float, enters: bool) -> None:
    traffic = place(T_JUNCTION, ("S-E", 1.5, 0), ("W-E", 10 * seconds, 10))
    assert predict(T_JUNCTION, traffic, steps=1).enters[0].tolist() == [enters, True]


@pytest.mark.parametrize(("late", "enters"), [(-0.01, False), (0.01, True)])
def test_sumo_gap_compares_times_of_arrival(late: float, enters: bool) -> None:
    own = place(T_JUNCTION, ("S-W", 1.5, 0))
    to_guarantee = 104.4585350 - (own.position[0] - 2)
    limit = sample(T_JUNCTION, 4, float(own.position[0]))[Sample.V_MAX]
    before = (to_guarantee / limit + 1 + late) * 13.8888889
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("W-E", before, 10))
    assert predict(T_JUNCTION, traffic, gap="sumo", steps=1).enters[0, 0] == enters


@pytest.mark.parametrize(("before", "enters"), [(5.0, False), (8.0, True)])
def test_sumo_gap_is_accepted_if_the_foe_leaves_first(before: float, enters: bool) -> None:
    # the foe's rear is at 150 and leaves at 160.716: 0.77 s at 50 km/h; 5 m take 0.6 s at 30 km/h, 8 m 0.96 s
    traffic = place(T_JUNCTION, ("S-W", before, 0), ("W-E", -5, 5))
    assert predict(T_JUNCTION, traffic, gap="sumo", steps=1).enters[0, 0] == enters


@pytest.mark.parametrize(("before", "enters"), [(3.9, False), (4.1, True)])
def test_standing_foe_counts_as_moving_at_one_metre_per_second(before: float, enters: bool) -> None:
    traffic = place(T_JUNCTION, ("S-E", 1.5, 0), ("W-E", before, 0))
    assert predict(T_JUNCTION, traffic, steps=1).enters[0, 0] == enters


def test_vehicle_told_to_wait_stops_before_its_stop_line() -> None:
    traffic = place(T_JUNCTION, ("W-E", 40, 12), ("S-W", 1.5, 0))
    result = predict(T_JUNCTION, traffic, np.array([1]), delta=np.tile([False, False], (50, 1)))
    line = 149 - result.position[:, 0] - 2
    assert (line > 0).all()
    assert 1.4 < line[-1] < 1.6
    assert result.speed[-1, 0] < 0.05


def test_assigned_order_binds_both_until_the_first_has_cleared() -> None:
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("W-E", 40, 12))
    yielder_first = predict(T_JUNCTION, traffic, np.array([1]))
    past = int(np.flatnonzero(yielder_first.position[:, 0] >= 104.458535)[0])  # its centre, not its rear
    assert 0 < past < 50
    assert yielder_first.enters[:50, 1].tolist() == [False] * past + [True] * (50 - past)
    assert yielder_first.enters[:, 0].all()
    prioritized_first = predict(T_JUNCTION, traffic, np.array([-1]))
    assert prioritized_first.enters[:, 1].all()
    assert not prioritized_first.enters[0, 0]


def test_vehicle_that_can_no_longer_stop_keeps_its_decision() -> None:
    braking = 12**2 / 8
    for before, committed in ((braking - 0.1, True), (braking + 0.1, False)):
        traffic = place(T_JUNCTION, ("E-S", before, 12), ("W-E", 20, 12))
        assert initial_memory(T_JUNCTION, traffic).delta[0] == committed
        assert predict(T_JUNCTION, traffic, steps=1).enters[0, 0] == committed


@pytest.mark.parametrize(
    ("before", "speed", "committed"), [(-1, 1, True), (-1, 0.9, False), (-4.9, 0, False), (-5, 0, True)]
)
def test_vehicle_past_its_line_is_committed_if_moving_or_inside_a_conflict(
    before: float, speed: float, committed: bool
) -> None:
    traffic = place(T_JUNCTION, ("E-S", before, speed))  # line at 153.5, first conflict at 158.46
    assert initial_memory(T_JUNCTION, traffic).delta.tolist() == [committed]


def test_foe_held_on_a_road_without_priority_does_not_hold_others() -> None:
    # SW-NE waits for a stream of SE-NE, which NE-SE does not meet; NE-SE would have to yield to SW-NE alone
    stream = [("SE-NE", 20.0 + 15 * k, 10.0) for k in range(4)]
    traffic = place(BENDPLATZ, ("NE-SE", 1.5, 0), ("SW-NE", 1.5, 0), *stream)
    result = predict(BENDPLATZ, traffic)
    assert result.enters[:5, :2].tolist() == [[False, False], *[[True, False]] * 4]
    alone = predict(BENDPLATZ, place(BENDPLATZ, ("NE-SE", 1.5, 0), ("SW-NE", 1.5, 0)))
    assert alone.enters[:5, :2].tolist() == [[False, True]] * 5


def test_foe_held_on_a_road_with_priority_holds_others() -> None:
    # SE-SW waits for a stream of NW-SW, which SW-NW does not cross; it will go as soon as that is over
    stream = [("NW-SW", 20.0 + 15 * k, 10.0) for k in range(4)]
    traffic = place(BENDPLATZ, ("SW-NW", 1.5, 0), ("SE-SW", 1.5, 0), *stream)
    assert not predict(BENDPLATZ, traffic).enters[:5, :2].any()


def test_foe_told_to_wait_by_a_maneuver_holds_nobody_by_rule() -> None:
    # E-S (rank 2) held by rule would not let S-W (rank 4) go; told to wait for W-S, which S-W does not meet, it does
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("E-S", 1.5, 0), ("W-S", 1.5, 0))
    assert conflicts(T_JUNCTION, traffic).tolist() == [[0, 1], [1, 2]]
    by_rule = predict(T_JUNCTION, traffic)
    assert by_rule.enters[:5].tolist() == [[False, False, True]] * 5
    assigned = predict(T_JUNCTION, traffic, np.array([0, -1]))
    assert assigned.enters[:5].tolist() == [[False, False, True], *[[True, False, True]] * 4]


@BOTH
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_opposing_left_turners_with_through_traffic_behind_do_not_freeze(intersection: Map, gap: Gap) -> None:
    if intersection is BENDPLATZ:
        queues = [("NE-SE", 1.5), ("NE-SW", 7.5), ("NE-NW", 13.5), ("SW-NW", 1.5), ("SW-NE", 7.5), ("SW-SE", 13.5)]
    else:
        queues = [("E-S", 1.5), ("E-W", 7.5), ("S-W", 1.5), ("S-W", 7.5), ("W-E", 1.5), ("W-S", 7.5)]
    traffic = place(intersection, *((name, before, 0) for name, before in queues))
    result = predict(intersection, traffic, gap=gap, steps=100)
    lines = np.array([intersection.routes[r].stop_line for r in traffic.route])
    assert (result.position[-1] - 2 > lines).all()
    assert result.minimum_distance > 0


@BOTH
def test_held_vehicle_able_to_stop_never_crosses_its_line(intersection: Map) -> None:
    generator = np.random.default_rng(7)
    for _ in range(8):
        traffic = random_traffic(intersection, generator, 8)
        result = predict(intersection, traffic)
        states = [replace(traffic, position=p, speed=v) for p, v in zip(result.position, result.speed, strict=True)]
        for i in range(8):
            if distance_to_stop_line(intersection, traffic, i) < braking_distance(traffic, i):
                continue
            distances = [distance_to_stop_line(intersection, state, i) for state in states]
            crossings = [step for step, (a, b) in enumerate(pairwise(distances)) if a >= 0 > b]
            assert all(result.enters[step, i] for step in crossings)


@pytest.mark.parametrize(("shift", "enters"), [(29.0, True), (31.0, False)])
def test_gap_network_accepts_above_zero(shift: float, enters: bool) -> None:
    identity = (np.array([[0.0, 0.0, 1.0, 0.0]]), np.zeros(1))
    network = Network(np.full(4, shift), np.ones(4), (identity, (np.eye(1), np.zeros(1))))
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))
    assert predict(T_JUNCTION, traffic, gap="network", gap_network=network, steps=1).enters[0, 0] == enters
