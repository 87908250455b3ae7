"""The predictor and the ranking, as their users meet them."""

from __future__ import annotations

import multiprocessing
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Prediction, Predictor, Traffic, Vehicle, crossing_orders, rank_maneuvers
from intersection_env.evaluation.errors import error_figures
from intersection_env.prediction.measures import crossing_order, time_loss
from tests.support.single_lane_junction import single_lane_source
from tests.support.twins import random_case

BENDPLATZ = Intersection.load("bendplatz")
T = Intersection.load("t_junction")


def busy() -> Traffic:
    """Eight vehicles, nineteen open pairs."""
    return Traffic.of(
        BENDPLATZ,
        [
            Vehicle("a", "NW-SE", 110, 12),
            Vehicle("b", "NW-SE", 95, 12),
            Vehicle("c", "NE-SW", 83, 0),
            Vehicle("d", "NE-SE", 75, 0),
            Vehicle("e", "SW-NW", 83, 0),
            Vehicle("f", "SE-NW", 100, 12),
            Vehicle("g", "SE-SW", 150, 0),
            Vehicle("h", "NW-NE", 140, 5),
        ],
    )


def arrays(count: int = 2, **changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "route": np.zeros(count, np.int32),
        "position": np.array([50.0, 100.0], np.float32)[:count],
        "speed": np.full(count, 5.0, np.float32),
        "length": np.full(count, 4.5, np.float32),
        "width": np.full(count, 1.8, np.float32),
    }
    return fields | changes


def test_idm_settles_at_the_speed_limit_on_an_empty_road() -> None:
    prediction = Predictor.load("idm").predict(Traffic.of(T, [Vehicle("a", "W-E", 20.0, 8.0)]))
    assert prediction.speed[0, -1, 0] == pytest.approx(50 / 3.6, abs=0.3)
    assert prediction.minimum_distance[0] == np.inf
    assert prediction.time[-1] == pytest.approx(10.0)


def test_time_loss_of_a_standing_vehicle_is_the_time_it_stands() -> None:
    line = T.routes[T.route_index("S-E")].stop_line
    vehicles = [Vehicle("waits", "S-E", line - 3.75, 0.0), Vehicle("first", "W-E", 60.0, 1.0)]
    traffic = Traffic.of(T, vehicles)
    prediction = Predictor.load("idm").predict(traffic, [("first", "waits")])
    assert prediction.time_loss[0, 0] == pytest.approx(10.0, abs=0.05)
    recorded = time_loss(T, int(traffic.route[1]), prediction.position[0, :, 1], prediction.speed[0, :, 1])
    assert recorded[-1] == pytest.approx(prediction.time_loss[0, 1], abs=1e-3)


def test_assigned_priority_turns_the_rule_around() -> None:
    vehicles = [Vehicle("side", "S-W", 88.0, 4.0), Vehicle("main", "W-E", 105.0, 10.0)]
    traffic = Traffic.of(T, vehicles)
    predictor = Predictor.load("idm")
    assert crossing_order(traffic, predictor.predict(traffic)).tolist() == [[-1]]
    assert crossing_order(traffic, predictor.predict(traffic, [("side", "main")])).tolist() == [[1]]


def test_opposing_left_turners_with_through_traffic_behind_do_not_freeze(tmp_path: Path) -> None:
    """Design page, Hold: each waits for the one queued behind the other."""
    source = tmp_path / "single_lane.json"
    source.write_text(single_lane_source())
    junction = Intersection.load(source)
    line = junction.routes[junction.route_index("W-N")].stop_line
    vehicles = [
        Vehicle("W left", "W-N", line - 2.6, 0.0),
        Vehicle("W through", "W-E", line - 9.5, 0.0),
        Vehicle("E left", "E-S", line - 2.6, 0.0),
        Vehicle("E through", "E-W", line - 9.5, 0.0),
    ]
    for gap in ("critical_gap", "sumo"):
        prediction = Predictor.load("idm", gap=gap).predict(Traffic.of(junction, vehicles))
        assert (prediction.position[0, -1] > line).all(), gap
        assert prediction.minimum_distance[0] > 0.0, gap


def test_ranking_puts_the_best_safe_order_first_and_counts_what_it_left_out() -> None:
    traffic = busy()
    predictor = Predictor.load("idm")
    table = rank_maneuvers(predictor, traffic)
    assert (~table.intervention).sum() == 1
    assert table.safe.is_monotonic_decreasing
    safe = table[table.safe]
    assert safe.total_time_loss.is_monotonic_increasing
    assert (table.worth_executing == (table.safe & (table.gain > 2.0))).all()
    assert table.attrs["left_out"] == 0
    capped = rank_maneuvers(predictor, traffic, limit=100)
    assert len(capped) == 101
    assert capped.attrs["left_out"] == len(table) - 101
    again = predictor.predict(traffic, table.priorities[0])
    assert again.time_loss.sum() == pytest.approx(table.total_time_loss[0], rel=1e-5)


def test_without_cooperative_vehicles_there_is_nothing_to_order() -> None:
    table = rank_maneuvers(Predictor.load("idm"), busy(), cooperative=[])
    assert len(table) == 2
    assert table.total_time_loss.nunique() == 1
    few = rank_maneuvers(Predictor.load("idm"), busy(), cooperative=["a", "c", "f"])
    named = {pair for row in few.priorities for pair in busy().words(row)}
    assert 2 < len(few) < 12
    assert {frozenset(pair) for pair in named} >= {frozenset(("a", "c")), frozenset(("c", "f"))}


def test_order_in_words_lists_the_first_of_each_pair_first() -> None:
    traffic = busy()
    table = rank_maneuvers(Predictor.load("idm"), traffic, limit=300)
    interventions = table[table.intervention]
    for order, priorities in zip(interventions.order, interventions.priorities, strict=True):
        place = {vehicle: k for k, vehicle in enumerate(order.split(", "))}
        for first, second in traffic.words(priorities):
            assert place[first] < place[second]


def test_words_and_assignments_are_inverse() -> None:
    traffic = busy()
    generator = np.random.default_rng(0)
    for _ in range(20):
        assignment = generator.integers(-1, 2, len(traffic.conflicts)).astype(np.int8)
        np.testing.assert_array_equal(traffic.assign(traffic.words(assignment)), assignment)


def test_far_vehicle_changes_nothing() -> None:
    vehicles = [Vehicle("a", "NE-SW", 80.0, 2.0), Vehicle("b", "SE-NW", 120.0, 12.0)]
    far = Vehicle("far", "NW-SE", 318.0, 12.0)
    predictor = Predictor.load("idm")
    one = predictor.predict(Traffic.of(BENDPLATZ, vehicles))
    other = predictor.predict(Traffic.of(BENDPLATZ, [*vehicles, far]))
    np.testing.assert_array_equal(one.position, other.position[:, :, :2])


def test_summary_equals_the_full_prediction() -> None:
    traffic, _ = random_case("bendplatz", 77)
    predictor = Predictor.load("idm")
    full, summary = predictor.predict(traffic), predictor.predict(traffic, trajectories=False)
    np.testing.assert_array_equal(full.time_loss, summary.time_loss)
    np.testing.assert_array_equal(full.minimum_distance, summary.minimum_distance)


def test_empty_traffic_is_predicted() -> None:
    prediction = Predictor.load("idm").predict(Traffic.of(T, []))
    assert prediction.position.shape == (1, 51, 0)
    assert len(rank_maneuvers(Predictor.load("idm"), Traffic.of(T, []))) == 2


def test_traffic_and_predictor_survive_pickling() -> None:
    traffic = pickle.loads(pickle.dumps(busy()))
    for one in (Predictor.load(), Predictor.load("idm", gap="sumo")):
        other = pickle.loads(pickle.dumps(one))
        np.testing.assert_array_equal(other.predict(traffic).position, one.predict(busy()).position)
    np.testing.assert_array_equal(traffic.conflicts, busy().conflicts)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"speed": np.zeros(2)}, TypeError, "speed must be an array of float32, not float64"),
        ({"route": np.zeros(2, np.int64)}, TypeError, "route must be an array of int32, not int64"),
        ({"speed": [1.0, 2.0]}, TypeError, "speed must be an array of float32, not list"),
        ({"speed": np.zeros(3, np.float32)}, ValueError, r"speed must have shape \(2,\)"),
        ({"length": np.array([4.0, -1.0], np.float32)}, ValueError, "vehicle y: length must be from 0.1.* not -1.0"),
        ({"speed": np.array([np.nan, 1.0], np.float32)}, ValueError, "vehicle x: speed must be .* not nan"),
        ({"speed": np.array([1.0, -2.0], np.float32)}, ValueError, "vehicle y: speed must be .* not -2.0"),
        ({"position": np.array([1.0, 999.0], np.float32)}, ValueError, "vehicle y: position must be from 0.* not 999"),
        ({"route": np.array([0, 99], np.int32)}, ValueError, "vehicle y: route 99 is not one of the map's 6"),
        ({"position": np.array([50.0, 52.0], np.float32)}, ValueError, "vehicles x and y overlap"),
        ({"max_speed": np.zeros(2, np.float32)}, ValueError, "vehicle x: max_speed must be at least 0.1"),
    ],
)
def test_wrong_traffic_is_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Traffic(T, ("x", "y"), **arrays(**changes))


def test_an_id_names_one_vehicle() -> None:
    with pytest.raises(TypeError, match="ids must be strings, not 3"):
        Traffic(T, (3, 4), **arrays())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='the id "x" names two vehicles'):
        Traffic(T, ("x", "x"), **arrays())


def test_more_vehicles_than_a_traffic_may_hold_are_refused() -> None:
    vehicles = [Vehicle(str(k), "W-E", 1.0 + 4.6 * k, 0.0, length=4.0) for k in range(65)]
    with pytest.raises(ValueError, match="65 vehicles are more than the 64"):
        Traffic.of(T, vehicles)


@pytest.mark.parametrize(
    ("priorities", "error", "message"),
    [
        ([("a", "nobody")], ValueError, 'no vehicle "nobody" in this traffic; there are a, b'),
        ([("a", "b")], ValueError, 'vehicles "a" and "b" do not conflict'),
        ([("a", "c"), ("c", "a")], ValueError, "each told to go before the other"),
        ([("b", "c"), ("c", "a")], ValueError, "vehicle . cannot go before vehicle .: the lane order"),
        ([("c", "a"), ("a", "e"), ("e", "c")], ValueError, "cannot go before"),
        (np.zeros((1, 19), np.int64), TypeError, "priorities must be int8, not int64"),
        (np.zeros(18, np.int8), ValueError, r"must have shape \(scenario, 19\)"),
        (np.zeros((1, 18), np.int8), ValueError, r"must have shape \(scenario, 19\)"),
        (np.full((1, 19), 2, np.int8), ValueError, r"must be \+1"),
        (np.full((1, 19), -128, np.int8), ValueError, r"must be \+1"),
        (("a", "c"), ValueError, r"must be pairs \(first, second\) of vehicle ids, not 'a'"),
        ([("a", "c", "e")], ValueError, r"must be pairs \(first, second\)"),
    ],
)
def test_wrong_priorities_are_refused(priorities: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Predictor.load("idm").predict(busy(), priorities)


def test_ranking_refuses_strangers_and_no_limit() -> None:
    with pytest.raises(ValueError, match='no vehicle "z"'):
        rank_maneuvers(Predictor.load("idm"), busy(), cooperative=["z"])
    with pytest.raises(ValueError, match="limit must be at least 1, not 0"):
        rank_maneuvers(Predictor.load("idm"), busy(), limit=0)


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


def test_traffic_keeps_its_own_arrays() -> None:
    position = np.array([50.0, 100.0], np.float32)
    traffic = Traffic(T, ("x", "y"), **arrays(position=position))
    position[0] = 5.0
    assert traffic.position[0] == 50.0
    with pytest.raises(ValueError, match="read-only"):
        traffic.position[0] = 1.0
    assert traffic == traffic
    assert len({traffic}) == 1


def test_error_figures_by_hand() -> None:
    figures = error_figures(np.array([-3.0, 0.0, 4.0]))
    assert figures.rmse == pytest.approx(np.sqrt(25 / 3))
    assert figures.mad == 3.0
    assert figures.quantile_80 == pytest.approx(3.6)
    with pytest.raises(ValueError, match="no samples"):
        error_figures(np.zeros(0))


def some_orders(traffic: Traffic, count: int) -> NDArray[np.int8]:
    return next(crossing_orders(traffic, batch=count))[:count]


def assert_same(one: Prediction, other: Prediction) -> None:
    for field in ("position", "speed", "acceleration", "enters", "present", "time_loss", "minimum_distance"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field), field)


@pytest.mark.parametrize("scenarios", [1, 15, 16, 17, 33, 100])
def test_threads_change_nothing(scenarios: int) -> None:
    """One scenario, whole blocks of every instruction set, and rests that are predicted one by one."""
    orders = some_orders(busy(), scenarios)
    assert len(orders) == scenarios
    alone = Predictor.load().predict(busy(), orders)
    for threads in (0, 2, 3):
        several = Predictor.load(threads=threads)
        for _ in range(3):
            assert_same(several.predict(busy(), orders), alone)
    summary = several.predict(busy(), orders, trajectories=False)
    np.testing.assert_array_equal(summary.time_loss, alone.time_loss)


def test_ranking_is_the_same_with_threads() -> None:
    one, two = (rank_maneuvers(Predictor.load(threads=threads), busy()) for threads in (1, 2))
    assert len(one) > 100
    assert one.order.tolist() == two.order.tolist()
    np.testing.assert_array_equal(one.total_time_loss, two.total_time_loss)


def test_callers_at_the_same_time_each_get_their_own_prediction() -> None:
    """Threads help one of them; the others work alone."""
    predictor, orders = Predictor.load(threads=2), some_orders(busy(), 100)
    parts = [orders[k : k + 40] for k in range(20)] * 4
    alone = [Predictor.load().predict(busy(), part) for part in parts[:20]] * 4
    with ThreadPoolExecutor(4) as callers:
        for found, wanted in zip(callers.map(lambda part: predictor.predict(busy(), part), parts), alone, strict=True):
            assert_same(found, wanted)


def _predict_in_child(predictor: Predictor, orders: NDArray[np.int8], wanted: NDArray[np.float32]) -> None:
    np.testing.assert_array_equal(predictor.predict(busy(), orders).time_loss, wanted)


def test_threads_survive_pickling_and_forking() -> None:
    predictor, orders = Predictor.load(threads=2), some_orders(busy(), 40)
    wanted = predictor.predict(busy(), orders).time_loss
    other = pickle.loads(pickle.dumps(predictor))
    assert other.threads == 2
    np.testing.assert_array_equal(other.predict(busy(), orders).time_loss, wanted)
    child = multiprocessing.get_context("fork").Process(target=_predict_in_child, args=(predictor, orders, wanted))
    child.start()
    child.join(60)
    assert child.exitcode == 0


def test_wrong_numbers_of_threads_are_refused() -> None:
    for threads in (-1, 257):
        with pytest.raises(ValueError, match=f"threads must be from 0, one a core, to 256, not {threads}"):
            Predictor.load(threads=threads)
    with pytest.raises(TypeError, match=r"threads is 1\.5; wanted a whole number"):
        Predictor.load(threads=1.5)  # type: ignore[arg-type]
