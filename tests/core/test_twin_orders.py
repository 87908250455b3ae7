"""The twin by hand: crossing orders, and what assignments imply."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.orders import acyclic_orientations, closure, complete, is_acyclic, lane_chains, orders
from tests.reference.pairs import conflicts
from tests.reference.predict import predict
from tests.support.placing import T_JUNCTION, place


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
