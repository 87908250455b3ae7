"""Hand-computed checks of the reference twin."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.reference.predictor import (
    Floats,
    Gap,
    Map,
    Network,
    Traffic,
    acyclic_orientations,
    body_distance,
    braking_distance,
    closure,
    complete,
    conflicts,
    distance_to_stop_line,
    evaluate,
    front,
    idm,
    initial_memory,
    is_acyclic,
    lane_chains,
    lead,
    lead_gaps,
    load_map,
    observe,
    orders,
    predict,
    random_traffic,
    sample,
)
from tests.support.paths import MAPS

T_JUNCTION, BENDPLATZ = load_map(MAPS / "t_junction.map"), load_map(MAPS / "bendplatz.map")
BOTH = pytest.mark.parametrize("intersection", [T_JUNCTION, BENDPLATZ], ids=["t_junction", "bendplatz"])


def place(intersection: Map, *vehicles: tuple[str, float, float]) -> Traffic:
    """Cars of 4 m x 2 m from (route id, front's distance before its stop line [m], speed [m/s])."""
    names = [route.id for route in intersection.routes]
    route = np.array([names.index(name) for name, _, _ in vehicles], dtype=np.int64)
    lines = [intersection.routes[r].stop_line for r in route]
    position = np.array([line - before - 2 for line, (_, before, _) in zip(lines, vehicles, strict=True)])
    count = len(vehicles)
    speed = np.array([v for _, _, v in vehicles], dtype=np.float64)
    return Traffic(route, position, speed, np.full(count, 4.0), np.full(count, 2.0), np.full(count, math.inf))


# The compiled map


@pytest.mark.parametrize("at", [b"stop_line 149", b"map 1"])
def test_map_with_one_changed_byte_is_refused(tmp_path: Path, at: bytes) -> None:
    data = (MAPS / "t_junction.map").read_bytes()
    (tmp_path / "bad.map").write_bytes(data.replace(at, at[:-1] + b"2", 1))
    with pytest.raises(ValueError, match="checksum"):
        load_map(tmp_path / "bad.map")


def test_map_holds_what_its_file_says() -> None:
    assert [route.id for route in T_JUNCTION.routes] == ["W-E", "W-S", "E-W", "E-S", "S-W", "S-E"]
    assert (T_JUNCTION.routes[3].stop_line, T_JUNCTION.routes[3].first_conflict) == (153.5, 158.464968)
    assert (T_JUNCTION.conflicts[2].yielder, T_JUNCTION.conflicts[2].merging) == (5, True)
    assert (T_JUNCTION.shared_lanes[1].split, T_JUNCTION.shared_lanes[1].offset) == (-1e6, -64.0820762)


@BOTH
def test_each_pair_of_routes_has_at_most_one_conflict(intersection: Map) -> None:
    pairs = [frozenset((c.yielder, c.prioritized)) for c in intersection.conflicts]
    assert len(pairs) == len(set(pairs))


def test_values_between_samples_are_linear_and_hold_beyond_the_ends() -> None:
    np.testing.assert_allclose(sample(T_JUNCTION, 0, 0.25)[:5], [-159.75, -1.65, 0, 3.25, 50 / 3.6], atol=1e-6)
    np.testing.assert_allclose(sample(T_JUNCTION, 0, -7.0)[:2], [-160, -1.65])
    np.testing.assert_allclose(sample(T_JUNCTION, 0, 999.0)[:2], [160, -1.65])


# Driving


def test_constant_velocity_moves_by_speed_times_time() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 100, 7)), driver="constant_velocity")
    np.testing.assert_allclose(result.position[:, 0], 149 - 102 + 7 * np.arange(51) * 0.2)
    assert (result.acceleration == 0).all()
    assert (result.speed == 7).all()
    np.testing.assert_allclose(result.time_loss, 10 * (1 - 7 / 13.8888889))


def test_vehicle_that_leaves_the_map_stays_where_it_left_and_loses_no_time() -> None:
    traffic = replace(place(T_JUNCTION, ("W-E", 0, 10)), position=np.array([315.0]))
    result = predict(T_JUNCTION, traffic, driver="constant_velocity")
    assert result.present[:, 0].tolist() == [True] * 3 + [False] * 48  # 315, 317, 319, 321
    assert result.position[-1, 0] == pytest.approx(321)
    assert result.speed[-1, 0] == 10
    assert result.time_loss[0] == pytest.approx(3 * 0.2 * (1 - 10 / 13.8888889))


def test_idm_alone_on_the_road_accelerates_as_by_hand() -> None:
    # s* = 1.5 + max(0, 10 - 10 * 17.8 / 6.3) = 1.5, (10 / 13.9)^4 = 0.72^4
    by_hand = 2.5 * (1 - 0.72**4 - 0.015**2)
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 100, 10)))
    assert result.acceleration[0, 0] == pytest.approx(by_hand, abs=1e-6)
    assert result.speed[1, 0] == pytest.approx(10 + 0.2 * by_hand, abs=1e-6)
    assert result.position[1, 0] == pytest.approx(47 + 2 + 0.02 * by_hand, abs=1e-6)


def test_idm_behind_a_lead_brakes_as_by_hand() -> None:
    desired = 1.5 + 10 + 10 * 4 / (2 * math.sqrt(10))
    assert idm(10, 20, 30, 6) == pytest.approx(2.5 * (1 - 1 / 16 - (desired / 30) ** 2))


def test_braking_is_limited_and_never_reverses() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 50, 13), ("W-E", 44, 0)), steps=20)
    assert result.acceleration[0, 0] == pytest.approx(-8)
    slow = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 50, 1), ("W-E", 45.9, 0)), steps=1)
    assert slow.speed[1, 0] == 0
    assert slow.acceleration[0, 0] == pytest.approx(-5)
    assert slow.position[1, 0] - slow.position[0, 0] == pytest.approx(0.1)


def test_last_acceleration_and_decision_repeat_the_step_before() -> None:
    result = predict(T_JUNCTION, place(T_JUNCTION, ("W-E", 60, 0)), steps=7)
    assert result.acceleration.shape == (8, 1)
    assert result.acceleration[7] == result.acceleration[6] != result.acceleration[5]


# Lead


def test_lead_is_in_range_up_to_one_hundred_metres() -> None:
    near = place(T_JUNCTION, ("W-E", 104, 5), ("W-E", 0, 3))
    assert lead(T_JUNCTION, near, np.ones(2, np.bool_), 0) == (1, 100.0, 3.0)
    far = place(T_JUNCTION, ("W-E", 104.01, 5), ("W-E", 0, 3))
    assert lead(T_JUNCTION, far, np.ones(2, np.bool_), 0) == (None, 100.0, 100 / 3.6)


def test_lead_turning_off_counts_until_its_rear_is_past_the_split() -> None:
    before = replace(place(T_JUNCTION, ("W-E", 0, 5), ("W-S", 0, 5)), position=np.array([140, 157.4]))
    assert lead_gaps(T_JUNCTION, before, 0, 1) == [pytest.approx(13.4)]  # rear 155.4 < 155.5
    assert lead_gaps(T_JUNCTION, replace(before, position=np.array([140, 157.6])), 0, 1) == []


def test_lead_coming_from_another_arm_counts_once_its_front_is_past_the_merge() -> None:
    before = replace(place(T_JUNCTION, ("W-E", 0, 5), ("S-E", 0, 5)), position=np.array([150, 98.9]))
    assert lead_gaps(T_JUNCTION, before, 0, 1) == []  # front 100.9 <= 101
    after = replace(before, position=np.array([150, 99.1]))
    assert lead_gaps(T_JUNCTION, after, 0, 1) == [pytest.approx(99.1 + 64.0820762 - 150 - 4)]
    assert lead_gaps(T_JUNCTION, after, 1, 0) == []


# Decisions


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
    limit = sample(T_JUNCTION, 4, float(own.position[0]))[4]
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


def test_foe_that_is_held_does_not_hold_others() -> None:
    # SE-SW waits for a stream of NW-SW, which SW-NW does not cross; SW-NW would have to yield to SE-SW alone
    stream = [("NW-SW", 20.0 + 15 * k, 10.0) for k in range(4)]
    traffic = place(BENDPLATZ, ("SW-NW", 1.5, 0), ("SE-SW", 1.5, 0), *stream)
    result = predict(BENDPLATZ, traffic)
    assert result.enters[:5, :2].tolist() == [[False, False], *[[True, False]] * 4]
    alone = predict(BENDPLATZ, place(BENDPLATZ, ("SW-NW", 1.5, 0), ("SE-SW", 1.5, 0)))
    assert alone.enters[:5, :2].tolist() == [[False, True]] * 5


def test_foe_told_to_wait_by_a_maneuver_holds_nobody_by_rule() -> None:
    # E-S (3) held by rule would not let S-W (4) go; told to wait for W-S, which S-W does not meet, it does
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


def test_replayed_decisions_give_the_same_prediction() -> None:
    traffic = random_traffic(BENDPLATZ, np.random.default_rng(6), 8)
    first = predict(BENDPLATZ, traffic)
    assert 0 < first.enters.mean() < 1
    again = predict(BENDPLATZ, traffic, delta=first.enters)
    np.testing.assert_array_equal(first.position, again.position)
    other = predict(BENDPLATZ, traffic, delta=~first.enters)
    np.testing.assert_array_equal(other.enters, ~first.enters)
    assert (first.position != other.position).any()


def test_permuting_vehicles_permutes_the_prediction() -> None:
    traffic = random_traffic(BENDPLATZ, np.random.default_rng(11), 8)
    order = np.random.default_rng(0).permutation(8)
    first = predict(BENDPLATZ, traffic)
    second = predict(BENDPLATZ, Traffic(*(getattr(traffic, name)[order] for name in Traffic.__dataclass_fields__)))
    np.testing.assert_array_equal(first.position[:, order], second.position)
    np.testing.assert_array_equal(first.enters[:, order], second.enters)
    assert first.minimum_distance == pytest.approx(second.minimum_distance)


# Networks


def tiny(inputs: int, weight: Floats, bias: float) -> Network:
    """One hidden unit and one output that doubles it."""
    hidden, output = (weight.reshape(1, inputs), np.array([bias])), (np.array([[2.0]]), np.array([0.5]))
    return Network(np.full(inputs, 1.0), np.full(inputs, 0.1), (hidden, output))


def test_networks_scale_their_inputs_and_bend_only_their_hidden_layers() -> None:
    network = tiny(2, np.array([1.0, -3.0]), 0.25)  # x = (1, 2): 1 - 6 + 0.25 = -4.75
    assert evaluate(network, np.array([11.0, 21.0]), "leaky_relu") == pytest.approx(2 * -0.0475 + 0.5)
    assert evaluate(network, np.array([11.0, 21.0]), "tanh") == pytest.approx(2 * math.tanh(-4.75) + 0.5)


def test_driving_network_sees_the_decision_and_gives_at_most_six() -> None:
    weight = np.zeros(12)
    weight[11] = 10.0  # delta: (1 - 1) * 0.1 * 10 = 0, (0 - 1) * 0.1 * 10 = -1
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))
    result = predict(T_JUNCTION, traffic, driver="network", driver_network=tiny(12, weight, 0.0), steps=1)
    assert result.enters[0].tolist() == [False, True]
    by_hand = [6 * math.tanh(2 * math.tanh(-1) + 0.5), 6 * math.tanh(0.5)]
    np.testing.assert_allclose(result.acceleration[0], by_hand)


@pytest.mark.parametrize(("shift", "enters"), [(29.0, True), (31.0, False)])
def test_gap_network_accepts_above_zero(shift: float, enters: bool) -> None:
    identity = (np.array([[0.0, 0.0, 1.0, 0.0]]), np.zeros(1))
    network = Network(np.full(4, shift), np.ones(4), (identity, (np.eye(1), np.zeros(1))))
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))
    assert predict(T_JUNCTION, traffic, gap="network", gap_network=network, steps=1).enters[0, 0] == enters


def test_observation_lists_the_features_in_order() -> None:
    traffic = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 25, 9), ("W-E", 40, 7))
    seen = observe(T_JUNCTION, traffic)
    np.testing.assert_allclose(seen.driving[2], [40, 7, 13.8888889, *[0] * 6, 11, 9, 0])
    np.testing.assert_allclose(seen.driving[0, [0, 1, 9, 10, 11]], [30, 8, 100, 100 / 3.6, 0])
    np.testing.assert_allclose(seen.gap[0], [162.730374 - (153.5 - 34), 8, 25, 9])


# Outputs


def test_distance_between_bodies_is_between_the_borders_of_their_circles() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 0), ("W-E", 50, 0))
    assert body_distance(T_JUNCTION, traffic, 0, 1) == pytest.approx(10 - 2 * 1 - 2 * 1)
    assert predict(T_JUNCTION, traffic, driver="constant_velocity").minimum_distance == pytest.approx(6)


def test_vehicles_whose_routes_do_not_touch_have_no_minimum_distance() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 5), ("E-W", 60, 5))
    assert predict(T_JUNCTION, traffic).minimum_distance == math.inf


def test_standing_vehicle_loses_all_its_time() -> None:
    traffic = place(T_JUNCTION, ("W-E", 60, 0))
    assert predict(T_JUNCTION, traffic, driver="constant_velocity").time_loss == pytest.approx([10])


# Crossing orders


def test_example_of_the_paper_has_eight_pairs_and_fourteen_orders() -> None:
    west_right, west_1, west_2, north_left, north_1, north_2 = range(6)
    pairs = [(north, west) for north in (north_1, north_2) for west in (west_right, west_1, west_2)]
    pairs += [(north_left, west_1), (north_left, west_2)]
    chains = [[west_right, west_1, west_2], [north_left, north_1, north_2]]
    assert len(pairs) == 8
    assert len(acyclic_orientations(pairs, chains, {})) == 14


def test_forced_pairs_keep_their_orientation_and_omitted_ones_none() -> None:
    pairs = [(0, 2), (1, 2)]
    assert acyclic_orientations(pairs, [], {}) == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    assert acyclic_orientations(pairs, [[0, 1]], {}) == {(1, 1), (1, -1), (-1, -1)}
    assert acyclic_orientations(pairs, [[0, 1]], {0: -1}) == {(-1, -1)}
    assert acyclic_orientations(pairs, [[0, 1]], {0: 0}) == {(0, 1), (0, -1)}


def test_cycle_is_found() -> None:
    assert is_acyclic([(0, 1), (1, 2), (0, 2)])
    assert not is_acyclic([(3, 0), (0, 1), (1, 2), (2, 0)])


def test_orders_of_two_vehicles_are_two_and_one_if_one_can_no_longer_stop() -> None:
    assert orders(T_JUNCTION, place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))) == {(1,), (-1,)}
    assert orders(T_JUNCTION, place(T_JUNCTION, ("E-S", 5, 8), ("W-E", 30, 8))) == {(1,)}
    assert orders(T_JUNCTION, place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 5, 8))) == {(-1,)}
    assert orders(T_JUNCTION, place(T_JUNCTION, ("E-S", 5, 8), ("W-E", 5, 8))) == {(0,)}
    assert orders(T_JUNCTION, place(T_JUNCTION, ("E-S", 30, 8), ("W-S", 30, 8)), cooperative={0}) == {(0,)}


def test_queue_is_ordered_by_position() -> None:
    traffic = place(T_JUNCTION, ("W-E", 20, 0), ("W-S", 3, 0), ("W-E", -1, 0), ("E-W", 3, 0))
    assert lane_chains(T_JUNCTION, traffic) == [[2, 1, 0]], "a vehicle that stands past its line is still waiting"


def test_assignments_are_completed_under_lane_order_and_transitively() -> None:
    assert closure([(0, 1), (0, 2), (3, 2)], [[1, 2]], [1, 0, 0]) == (1, 1, 0)
    assert closure([(1, 0), (0, 2), (3, 1)], [[1, 2], [3, 0]], [-1, 0, 0]) == (-1, 1, 1)
    assert closure([(0, 1), (1, 2), (2, 0)], [], [1, 1, 0]) == (1, 1, -1)
    with pytest.raises(ValueError, match="contradict"):
        closure([(0, 1), (0, 2)], [[1, 2]], [1, -1])


def test_assignments_that_put_second_who_can_no_longer_stop_are_refused() -> None:
    traffic = place(T_JUNCTION, ("E-S", 5, 8), ("W-E", 30, 8))
    with pytest.raises(ValueError, match="can no longer stop"):
        predict(T_JUNCTION, traffic, np.array([-1]))


def test_assignments_in_a_circle_are_refused() -> None:
    traffic = place(T_JUNCTION, ("E-S", 30, 0), ("W-E", 30, 0), ("S-W", 30, 0))
    assert conflicts(T_JUNCTION, traffic).tolist() == [[0, 1], [2, 0], [2, 1]]
    with pytest.raises(ValueError, match="contradict"):
        complete(T_JUNCTION, traffic, np.array([1, 1, -1]))
    assert len(orders(T_JUNCTION, traffic)) == 6


# Random traffic


@BOTH
def test_random_traffic_keeps_its_distances_and_has_conflicts(intersection: Map) -> None:
    generator, pairs = np.random.default_rng(5), 0
    for _ in range(10):
        traffic = random_traffic(intersection, generator, 8)
        pairs += len(conflicts(intersection, traffic))
        for i in range(8):
            gaps = [gap for j in range(8) if j != i for gap in lead_gaps(intersection, traffic, i, j)]
            assert min(gaps, default=1.0) >= 1.0
            assert front(traffic, i) > 0
            assert traffic.speed[i] <= 1.1 * min(50 / 3.6, traffic.max_speed[i]) + 1e-5
    assert pairs > 40
