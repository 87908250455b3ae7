"""The ranking of maneuvers equals one written out the slow way, and says what its users ask."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from intersection_env import Prediction, Predictor, Traffic, Vehicle, _core, crossing_orders, forecast, rank_maneuvers
from intersection_env.prediction.measures import crossing_order
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference.outputs import followed
from tests.support.busy_traffic import BENDPLATZ, T, busy
from tests.support.forecasts import forecasting
from tests.support.twins import CASES, random_case, twin_map


def in_words(traffic: Traffic, priorities: NDArray[np.int8], twin: reference.Traffic) -> str:
    """The vehicle nearest to its line among those that wait for nobody who is still to come, again and again."""
    waits = {(first, second) for first, second in traffic.words(priorities)}
    to_come = {vehicle for pair in waits for vehicle in pair}
    for chain in reference.lane_chains(twin_map(traffic.intersection.name), twin):
        waits |= {(traffic.ids[a], traffic.ids[b]) for k, a in enumerate(chain) for b in chain[k + 1 :]}
    lines = {
        vehicle: traffic.intersection.routes[route].stop_line - float(position)
        for vehicle, route, position in zip(traffic.ids, traffic.route, traffic.position, strict=True)
    }
    sequence = []
    while to_come:
        ready = [v for v in traffic.ids if v in to_come and not any((w, v) in waits for w in to_come)]
        sequence.append(min(ready, key=lines.__getitem__))
        to_come.remove(sequence[-1])
    return ", ".join(sequence) or "nobody waits"


def orders_followed(
    traffic: Traffic, twin: reference.Traffic, orders: NDArray[np.int8], prediction: Prediction
) -> NDArray[np.bool_]:
    """(order,), by the twin, of the core's trajectories."""
    completed = _core.complete(traffic.intersection.core, traffic.core, orders)
    map_ = twin_map(traffic.intersection.name)
    position = prediction.position.astype(np.float64)
    return followed(
        map_, twin, traffic.conflicts.astype(np.int64), completed.astype(np.int64), position, prediction.present
    )


@pytest.mark.parametrize("name", MAP_NAMES)
def test_ranking_is_that_of_all_orders_predicted_and_sorted(name: str) -> None:
    ranked = unfollowed = 0
    for seed in range(30 * CASES):
        traffic, twin = random_case(name, 80_000 + seed)
        predictor = Predictor.load(("idm", "gap", "constant_velocity")[seed % 3])
        default = predictor.predict(traffic)
        realized = crossing_order(traffic, default)[0]
        orders = np.concatenate([np.zeros_like(realized)[None], *crossing_orders(traffic, preferred=realized)])
        orders = orders[(orders != 0).any(axis=1) | (np.arange(len(orders)) == 0)]  # the first is no intervention
        if len(orders) > 200:
            continue
        ranked += 1
        # batched as the core does it: a sanitized build rounds a batch and a single scenario differently
        summary = predictor.predict(traffic, orders[1:])
        time_loss = np.concatenate([default.time_loss, summary.time_loss])
        distance = np.concatenate([default.minimum_distance, summary.minimum_distance])
        followed = np.concatenate([[True], orders_followed(traffic, twin, orders[1:], summary)])
        total, safe = time_loss.astype(np.float64).sum(axis=1), followed & (distance >= 0.5)
        rows = sorted(range(len(orders)), key=lambda k: (not safe[k], not followed[k], total[k]))
        unfollowed += int((~followed).sum())
        table = rank_maneuvers(predictor, traffic, by="prediction")
        np.testing.assert_allclose(table.total_time_loss, total[rows], rtol=1e-12)
        np.testing.assert_array_equal(table.followed, followed[rows])
        np.testing.assert_array_equal(table.safe, safe[rows])
        np.testing.assert_array_equal(table.minimum_distance, distance[rows])
        np.testing.assert_array_equal(np.stack(table.priorities.tolist()), orders[rows])
        np.testing.assert_allclose(table.worst_time_loss, time_loss.max(axis=1, initial=0.0)[rows])
        np.testing.assert_allclose(table.gain, total[0] - total[rows], atol=1e-9)
        np.testing.assert_array_equal(table.worth_executing, table.safe & (table.gain > 2.0))
        words = [in_words(traffic, orders[k], twin) if k else "no intervention" for k in rows]
        assert table.order.tolist() == words
    assert ranked > 12 * CASES
    assert unfollowed > 20 * CASES


def test_a_limit_keeps_the_orders_nearest_to_no_intervention() -> None:
    traffic, _ = random_case("bendplatz", 20_003)
    predictor = Predictor.load("gap")
    realized = crossing_order(traffic, predictor.predict(traffic))[0]
    first = next(crossing_orders(traffic, preferred=realized, batch=2))
    table = rank_maneuvers(predictor, traffic, limit=2, by="prediction")
    kept = {tuple(row) for row in table.priorities[table.intervention]}
    assert kept == {tuple(row) for row in first}
    assert table.attrs["left_out"] == len(rank_maneuvers(predictor, traffic, by="prediction")) - 3


def expected(
    predictor: Predictor, traffic: Traffic, twin: reference.Traffic, cooperative: NDArray[np.bool_]
) -> dict[tuple[int, ...] | None, dict[str, float]]:
    """The columns of each maneuver, by what it imposes, and of no intervention, by None."""
    orders = np.concatenate(list(crossing_orders(traffic)))
    logit = predictor.core_policy.evaluate_order(predictor.bound_to(traffic.intersection).observe_orders(traffic.core))
    weight = np.exp(0.5 * (orders @ logit.astype(np.float64)))
    predicted = predictor.predict(traffic, orders)
    lost = predicted.time_loss.astype(np.float64)
    total, worst = lost.sum(axis=1), lost.max(axis=1, initial=0.0)
    followed = orders_followed(traffic, twin, orders, predicted)
    safe = followed & (predicted.minimum_distance >= 0.5)
    imposed = np.where(cooperative[traffic.conflicts].all(axis=1), orders, 0)
    groups: dict[tuple[int, ...] | None, NDArray[np.bool_]] = {
        tuple(row): (imposed == row).all(axis=1) for row in imposed.tolist() if any(row)
    }
    of_all = weight / weight.sum()
    columns = {}
    for key, rows in (groups | {None: np.ones(len(orders), np.bool_)}).items():
        share = np.where(rows, weight, 0.0) / weight[rows].sum()
        likely = int(np.argmax(share))
        gains = total[None, :] - total[:, None]  # (with it, without)
        columns[key] = {
            "total_time_loss": share @ total,
            "worst_time_loss": share @ worst,
            "gain": of_all @ total - share @ total,
            "chance_worthwhile": 0.0 if key is None else share @ (gains > 2.0) @ of_all,
            "chance_unsafe": share @ ~safe,
            "minimum_distance": float(predicted.minimum_distance[likely]),
            "followed": bool(followed[likely]),
            "safe": bool(safe[likely]),
        }
    return columns


def ranked_as_expected(
    predictor: Predictor, traffic: Traffic, twin: reference.Traffic, cooperative: NDArray[np.bool_]
) -> pd.DataFrame:
    """The ranking, found to be what it should be."""
    truth = expected(predictor, traffic, twin, cooperative)
    ids = None if cooperative.all() else [traffic.ids[i] for i in np.flatnonzero(cooperative)]
    table = rank_maneuvers(predictor, traffic, ids)
    rows = table.to_dict("records")
    found = {tuple(row["priorities"].tolist()) if row["intervention"] else None: row for row in rows}
    assert found.keys() == truth.keys()
    for key, columns in truth.items():
        assert {column: found[key][column] for column in columns} == pytest.approx(columns, abs=1e-6), key
    np.testing.assert_array_equal(table.worth_executing, table.safe & (table.gain > 2.0))
    places = [(not row["safe"], not row["followed"], row["total_time_loss"]) for row in rows]
    assert places == sorted(places)
    return table


@pytest.mark.parametrize(("name", "seed"), [("bendplatz", 828), ("t_junction", 602), ("crossroads", 488)])
def test_a_maneuver_is_as_safe_as_its_most_probable_order_though_another_is_found_first(name: str, seed: int) -> None:
    """In these traffics the pairs' more probable directions cannot all be had, and the most certain ones cost most."""
    traffic, twin = random_case(name, 83_000 + seed)
    predictor = Predictor(forecasting(np.random.default_rng(seed))[0], "random")
    (first,) = forecast(predictor, traffic, limit=1).orders
    most_probable = forecast(predictor, traffic).orders[0]
    distances = predictor.predict(traffic, np.stack([first, most_probable])).minimum_distance
    assert abs(distances[1] - distances[0]) > 0.1
    ranked_as_expected(predictor, traffic, twin, np.zeros(len(traffic), np.bool_))


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("who", ["all", "some", "nobody"])
def test_expected_ranking_is_over_all_orders_with_their_probabilities(name: str, who: str) -> None:
    ranked = unsure = 0
    for seed in range(30 * CASES):
        traffic, twin = random_case(name, 83_000 + seed)
        predictor = Predictor.load(("gap", "gail", "idm_calibrated")[seed % 3])
        if sum(len(batch) for batch in crossing_orders(traffic)) > 200 or not len(traffic.conflicts):
            continue
        ranked += 1
        flags = {"all": np.ones, "nobody": np.zeros}.get(who, np.ones)(len(traffic), np.bool_)
        if who == "some":
            flags = np.random.default_rng(seed).random(len(traffic)) < 0.6
        table = ranked_as_expected(predictor, traffic, twin, flags)
        unsure += int(((table.chance_worthwhile > 0.1) & (table.chance_worthwhile < 0.9)).sum())
        assert who != "nobody" or len(table) == 1
    assert ranked > 12 * CASES
    assert who == "nobody" or unsure > 2 * CASES


def test_by_prediction_a_policy_that_forecasts_ranks_as_it_would_without() -> None:
    full = Predictor.load("gap")
    plain = Predictor(replace(full.policy, order_network=None, spread=None), "plain")
    for seed in range(5):
        traffic, _ = random_case("bendplatz", 83_100 + seed)
        one, other = rank_maneuvers(full, traffic, by="prediction"), rank_maneuvers(plain, traffic)
        pd.testing.assert_frame_equal(one, other)
        assert not {"chance_worthwhile", "chance_unsafe"} & set(one.columns)


def test_by_expectation_a_limit_keeps_the_most_probable_orders() -> None:
    predictor = Predictor.load("gap")
    whole = forecast(predictor, busy(), mass=1.0, most=10_000)
    table = rank_maneuvers(predictor, busy(), limit=1)
    assert table.intervention.sum() == 1
    np.testing.assert_array_equal(table.priorities[table.intervention].item(), whole.orders[0])
    assert table.attrs["left_out"] == whole.feasible - 1
    assert (table.gain == 0.0).all(), "no intervention is expected over the same one order"
    few = rank_maneuvers(predictor, busy(), limit=10)
    truncated = forecast(predictor, busy(), mass=1.0, most=10_000, limit=10)
    kept = {tuple(row.tolist()) for row in few.priorities[few.intervention]}
    assert kept == {tuple(row) for row in truncated.orders.tolist()}
    none = few[~few.intervention].iloc[0]
    assert none.total_time_loss == pytest.approx(truncated.expected_time_loss().sum(), rel=1e-9)
    everything = rank_maneuvers(predictor, busy(), limit=None)
    assert len(everything) == whole.feasible + 1
    assert everything.attrs["left_out"] == 0


def test_crossing_order_is_that_of_the_first_fronts_in_each_conflict() -> None:
    seen = set()
    for seed in range(30):
        traffic, twin = random_case("bendplatz", 81_000 + seed)
        prediction = Predictor.load("idm").predict(traffic)
        conflicts = {(c.yielder, c.prioritized): c for c in twin_map("bendplatz").conflicts}
        for way, (i, j) in zip(crossing_order(traffic, prediction)[0], traffic.conflicts.tolist(), strict=True):
            conflict = conflicts[int(twin.route[i]), int(twin.route[j])]
            fronts = [prediction.position[0, :, k] + traffic.length[k] / 2 for k in (i, j)]
            lines = (np.float32(conflict.begin_yielder), np.float32(conflict.begin_prioritized))
            steps = [next((t for t in range(51) if f[t] >= line), 51) for f, line in zip(fronts, lines, strict=True)]
            assert way == (1 if steps[0] < steps[1] else -1 if steps[1] < 51 else 0)
            seen.add(int(way))
    assert seen == {-1, 0, 1}


def test_an_order_that_its_own_prediction_does_not_follow_is_neither_safe_nor_worth_executing() -> None:
    """At constant velocity the side road is through long before the main road comes, whatever is ordered."""
    vehicles = [Vehicle("side", "S-W", 85.0, 8.0), Vehicle("main", "W-E", 20.0, 5.0)]
    table = rank_maneuvers(Predictor.load("constant_velocity"), Traffic.of(T, vehicles))
    assert table.order.tolist() == ["no intervention", "side, main", "main, side"]
    assert (table.minimum_distance > 0.5).all()
    assert table.followed.tolist() == table.safe.tolist() == [True, True, False]
    assert not table.worth_executing.any()


@pytest.mark.parametrize("beyond", [-0.01, 0.12])
def test_who_stops_within_a_tenth_of_a_metre_follows(beyond: float) -> None:
    """Who creeps 1 cm before its conflict, and is to be second, cannot help coming a little into it."""
    route = T.routes[T.route_index("E-S")]
    creeps = Vehicle("creeps", "E-S", route.first_conflict + beyond - 2.25, 0.9)
    table = rank_maneuvers(Predictor.load("idm"), Traffic.of(T, [creeps, Vehicle("main", "W-E", 80.0, 12.0)]))
    assert table.followed.all()
    assert ("main, creeps" in table.order.tolist()) == (beyond < 0.0), "within its conflict nobody is put second"


def test_orders_of_a_driver_that_obeys_nobody_sort_behind() -> None:
    table = rank_maneuvers(Predictor.load("constant_velocity"), busy(), limit=200)
    assert 0 < table.followed.sum() < len(table)
    assert not (table.safe & ~table.followed).any()
    assert not (table.worth_executing & ~table.followed).any()
    assert table.followed.is_monotonic_decreasing
    assert table[~table.intervention].followed.all()


@pytest.mark.parametrize("policy", ["gail", "ppo", "gap", "idm_calibrated", "rollout_gradient"])
def test_orders_of_a_shipped_driver_are_followed(policy: str) -> None:
    orders = 0
    for seed in range(20):
        traffic, _ = random_case("bendplatz", 82_000 + seed)
        table = rank_maneuvers(Predictor.load(policy), traffic, limit=100)
        assert table.followed.all(), seed
        orders += len(table)
    assert orders > 200


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
    assert table["order"].tolist() == ["no intervention"]
    few = rank_maneuvers(Predictor.load("idm"), busy(), cooperative=["a", "c", "g"])
    named = {pair for row in few.priorities for pair in busy().words(row)}
    assert 2 < len(few) < 12
    assert {frozenset(pair) for pair in named} >= {frozenset(("a", "c")), frozenset(("c", "g"))}


def test_order_in_words_lists_the_first_of_each_pair_first() -> None:
    traffic = busy()
    table = rank_maneuvers(Predictor.load("idm"), traffic, limit=300)
    interventions = table[table.intervention]
    for order, priorities in zip(interventions.order, interventions.priorities, strict=True):
        place = {vehicle: k for k, vehicle in enumerate(order.split(", "))}
        for first, second in traffic.words(priorities):
            assert place[first] < place[second]


def test_ranking_refuses_strangers_and_no_limit() -> None:
    with pytest.raises(ValueError, match='no vehicle "z"'):
        rank_maneuvers(Predictor.load("idm"), busy(), cooperative=["z"])
    with pytest.raises(ValueError, match="limit must be at least 1, not 0"):
        rank_maneuvers(Predictor.load("idm"), busy(), limit=0)


def test_ranking_refuses_what_it_cannot_rank_by() -> None:
    with pytest.raises(ValueError, match='by must be "expectation", "prediction" or None, not \'luck\''):
        rank_maneuvers(Predictor.load("gap"), busy(), by="luck")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='the policy "idm" holds no order network'):
        rank_maneuvers(Predictor.load("idm"), busy(), by="expectation")


@pytest.mark.parametrize("by", ["expectation", "prediction"])
def test_where_nothing_can_be_ordered_no_intervention_is_the_only_row(by: Literal["expectation", "prediction"]) -> None:
    """Nobody meets anybody; and nobody takes instructions."""
    alone = Traffic.of(BENDPLATZ, [Vehicle("one", "SE-NW", 90.0, 10.0)])
    for traffic, cooperative in ((alone, None), (busy(), [])):
        table = rank_maneuvers(Predictor.load(), traffic, cooperative, by=by)
        assert table["order"].tolist() == ["no intervention"]


def test_no_intervention_loses_the_time_that_a_forecast_of_all_orders_expects() -> None:
    predictor, traffic = Predictor.load(), busy()
    table = rank_maneuvers(predictor, traffic)
    expected = forecast(predictor, traffic, mass=1.0, most=10_000).expected_time_loss().sum()
    assert table.loc[~table["intervention"], "total_time_loss"].item() == pytest.approx(expected, abs=1e-4)
