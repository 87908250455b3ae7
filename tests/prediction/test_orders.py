"""Crossing orders equal brute force, on the shipped maps and on the paper's example."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle, crossing_orders, rank_maneuvers
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.support.busy_traffic import busy
from tests.support.single_lane_junction import single_lane_source
from tests.support.twins import CASES, random_case, twin_map


def enumerated(traffic: Traffic, cooperative: list[str] | None = None, batch: int = 7) -> list[tuple[int, ...]]:
    return [tuple(order) for orders in crossing_orders(traffic, cooperative, batch=batch) for order in orders.tolist()]


@pytest.mark.parametrize("name", MAP_NAMES)
def test_orders_equal_brute_force_from_0_to_12_pairs(name: str) -> None:
    seen: dict[int, int] = {}
    wanted = 2 * CASES
    for seed in range(600 * CASES):
        traffic, twin = random_case(name, 20_000 + seed)
        pairs = len(traffic.conflicts)
        if pairs > 12 or seen.get(pairs, 0) >= wanted:
            continue
        seen[pairs] = seen.get(pairs, 0) + 1
        orders = enumerated(traffic)
        assert len(orders) == len(set(orders)), "no order comes twice"
        assert set(orders) == reference.orders(twin_map(name), twin)
    assert set(seen) == set(range(13))


def closed(name: str, twin: reference.Traffic, order: tuple[int, ...]) -> tuple[int, ...] | None:
    """The order with what it implies, None if that cannot be carried out."""
    try:
        return tuple(reference.complete(twin_map(name), twin, np.array(order, np.int64)).tolist())
    except ValueError:
        return None


@pytest.mark.parametrize("name", MAP_NAMES)
def test_only_pairs_of_cooperative_vehicles_are_ordered(name: str) -> None:
    checked = 0
    for seed in range(60):
        traffic, twin = random_case(name, 30_000 + seed)
        if not 1 <= len(traffic.conflicts) <= 10:
            continue
        flags = np.random.default_rng(seed).integers(0, 2, len(traffic)).astype(bool)
        cooperative = [traffic.ids[i] for i in np.flatnonzero(flags)]
        truth = reference.orders(twin_map(name), twin, set(np.flatnonzero(flags).tolist()))
        assert set(enumerated(traffic, cooperative)) == {closed(name, twin, order) for order in truth} - {None}
        checked += 1
    assert checked >= 15


def test_the_papers_example_gives_8_pairs_and_14_orders(tmp_path: Path) -> None:
    """Queues W (right, straight, straight) and N (left, straight, straight) of a single-lane junction."""
    source = tmp_path / "single_lane.json"
    source.write_text(single_lane_source())
    junction = Intersection.load(source)
    queue = [(20.0, 0), (27.0, 1), (34.0, 2)]
    routes = {"W": ("W-S", "W-E", "W-E"), "N": ("N-E", "N-S", "N-S")}
    vehicles = [
        Vehicle(f"{arm}{k + 1}", routes[arm][k], junction.routes[0].stop_line - back, 5.0)
        for arm in ("W", "N")
        for back, k in queue
    ]
    traffic = Traffic.of(junction, vehicles)
    orders = enumerated(traffic)
    assert len(traffic.conflicts) == 8
    assert len(orders) == len(set(orders)) == 14


def test_preferred_order_comes_first() -> None:
    traffic, _ = random_case("bendplatz", 20_003)
    orders = enumerated(traffic)
    assert len(orders) >= 4
    for order in orders:
        first = next(crossing_orders(traffic, preferred=np.array(order, np.int8), batch=1))
        assert tuple(first[0].tolist()) == order


def test_vehicle_that_can_no_longer_stop_is_never_second() -> None:
    junction = Intersection.load("t_junction")
    line = junction.routes[junction.route_index("S-W")].stop_line
    late = Vehicle("late", "S-W", line - 3.0, 8.0)
    traffic = Traffic.of(junction, [late, Vehicle("main", "W-E", 100.0, 10.0)])
    assert enumerated(traffic) == [(1,)]
    with pytest.raises(ValueError, match="vehicle late cannot wait for vehicle main: it can no longer stop"):
        Predictor.load("idm").predict(traffic, [("main", "late")])


def test_traffic_without_conflicts_has_one_empty_order() -> None:
    junction = Intersection.load("t_junction")
    assert enumerated(Traffic.of(junction, [])) == [()]
    assert enumerated(Traffic.of(junction, [Vehicle("only", "W-E", 50.0, 5.0)])) == [()]


def test_orders_refuse_what_they_cannot_use() -> None:
    traffic = busy()
    with pytest.raises(TypeError, match='collection of vehicle ids, not the one id "a"'):
        rank_maneuvers(Predictor.load("idm"), traffic, cooperative="a")
    with pytest.raises(ValueError, match="batch must be at least 1, not 0"):
        next(crossing_orders(traffic, batch=0))
    with pytest.raises(TypeError, match="preferred must be int8, not float64"):
        next(crossing_orders(traffic, preferred=np.zeros(19)))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"preferred must have shape \(19,\)"):
        next(crossing_orders(traffic, preferred=np.zeros(3, np.int8)))
