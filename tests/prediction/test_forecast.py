"""Forecasts: orders with probabilities, conditions and quantiles, as their users meet them."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import (
    Forecast,
    Predictor,
    Traffic,
    Vehicle,
    _core,
    crossing_orders,
    forecast,
)
from intersection_env.policies.named import POLICIES
from tests.support.busy_traffic import BENDPLATZ, T, busy
from tests.support.forecasts import NO_SPREAD, assert_same, by_order, few, forecasting
from tests.support.twins import random_case

SHIPPED = sorted(path.stem for path in POLICIES.glob("*.policy"))
ALL: dict[str, Any] = {"mass": 1.0, "most": 10_000}
LEVELS = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor.load("idm_calibrated")


def test_probabilities_of_all_orders_sum_to_one_and_fall(predictor: Predictor) -> None:
    found = forecast(predictor, busy(), **ALL)
    feasible = {tuple(order) for batch in crossing_orders(busy()) for order in batch.tolist()}
    assert found.feasible == len(feasible) > 100
    assert set(by_order(found)) <= feasible
    assert found.probability.sum() == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(found.probability) <= 0.0).all()
    assert found.left_out == 0
    assert found.prediction.position.shape[0] == len(found.orders) == len(found.words())
    np.testing.assert_array_equal(found.order, np.arange(len(found.orders)))
    np.testing.assert_allclose(found.weight, found.probability, rtol=1e-9)


def test_yielder_first_sums_the_orders_in_which_it_does(predictor: Predictor) -> None:
    found = forecast(predictor, busy(), **ALL)
    first = found.probability @ (found.orders > 0)
    np.testing.assert_allclose(found.yielder_first, first, atol=1e-9)
    part = forecast(predictor, busy(), most=1)
    np.testing.assert_array_equal(part.yielder_first, found.yielder_first)
    assert ((found.yielder_first > 0.01) & (found.yielder_first < 0.99)).any()


def test_what_is_given_is_a_condition_on_all_others(predictor: Predictor) -> None:
    free = by_order(forecast(predictor, busy(), **ALL))
    for seed in range(5):
        order = list(free)[int(np.random.default_rng(seed).integers(len(free) // 2))]
        is_held = np.random.default_rng(seed).random(len(order)) < 0.15
        given = np.where(is_held, np.array(order, np.int8), np.int8(0))
        holds = {o: p for o, p in free.items() if all(g in (0, way) for g, way in zip(given, o, strict=True))}
        found = by_order(forecast(predictor, busy(), given, **ALL))
        assert all(g in (0, way) for order in found for g, way in zip(given, order, strict=True))
        total = sum(holds.values())
        assert found == {o: pytest.approx(holds.get(o, 0.0) / total, rel=1e-6, abs=1e-9) for o in found}
        assert found.keys() >= {o for o, p in holds.items() if p > 1e-12 * total}  # the mass is whole before the others
        assert given.any()


def test_priorities_are_given_by_ids_too(predictor: Predictor) -> None:
    by_ids = forecast(predictor, few(), [("side", "main")])
    by_array = forecast(predictor, few(), few().assign([("side", "main")]))
    assert_same(by_ids, by_array)
    pair = few().conflicts.tolist().index([1, 0])
    assert (by_ids.orders[:, pair] == 1).all()
    assert by_ids.yielder_first[pair] == 1.0
    assert forecast(predictor, few()).yielder_first[pair] < 0.9


@pytest.mark.parametrize(
    ("priorities", "error", "message"),
    [
        ([("b", "c"), ("c", "a")], ValueError, "vehicle . cannot go before vehicle .: the lane order"),
        ([("c", "a"), ("a", "e"), ("e", "c")], ValueError, "vehicle . cannot go before vehicle ."),
        ([("a", "nobody")], ValueError, 'no vehicle "nobody"'),
        (np.zeros((2, 19), np.int8), ValueError, "priorities of a forecast are of one scenario, not of 2"),
        (np.zeros(18, np.int8), ValueError, r"must have shape \(scenario, 19\)"),
        (np.zeros(19, np.int64), TypeError, "priorities must be int8, not int64"),
    ],
)
def test_contradictory_or_malformed_priorities_are_refused_with_vehicle_ids(
    predictor: Predictor, priorities: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        forecast(predictor, busy(), priorities)


def test_who_can_no_longer_stop_cannot_be_given_to_wait(predictor: Predictor) -> None:
    line = T.routes[T.route_index("S-W")].stop_line
    traffic = Traffic.of(T, [Vehicle("late", "S-W", line - 3.0, 8.0), Vehicle("main", "W-E", 100.0, 10.0)])
    assert by_order(forecast(predictor, traffic)) == {(1,): 1.0}
    with pytest.raises(ValueError, match="vehicle late cannot wait for vehicle main: it can no longer stop"):
        forecast(predictor, traffic, [("main", "late")])


def test_pair_of_which_neither_can_stop_keeps_its_own_probability(predictor: Predictor) -> None:
    lines = {name: T.routes[T.route_index(name)].stop_line for name in ("E-S", "W-E")}
    traffic = Traffic.of(T, [Vehicle(name, name, line - 7.0, 8.0) for name, line in lines.items()])
    found = forecast(predictor, traffic)
    assert by_order(found) == {(0,): 1.0}
    logit = predictor.core_policy.evaluate_order(predictor.bound_to(T).observe_orders(traffic.core))
    assert found.yielder_first[0] == pytest.approx(1.0 / (1.0 + np.exp(-float(logit[0]))))


@pytest.mark.parametrize("mass", [0.3, 0.6, 0.95])
def test_as_many_orders_as_have_the_mass_are_predicted_and_no_more_than_the_most(
    predictor: Predictor, mass: float
) -> None:
    whole = forecast(predictor, busy(), **ALL)
    wanted = int(np.flatnonzero(np.cumsum(whole.probability) >= mass)[0]) + 1
    found = forecast(predictor, busy(), mass=mass, most=10_000)
    assert len(found.orders) == wanted
    np.testing.assert_array_equal(found.orders, whole.orders[:wanted])
    np.testing.assert_array_equal(found.probability, whole.probability[:wanted])
    assert found.weight.sum() == pytest.approx(1.0)
    assert len(forecast(predictor, busy(), mass=mass, most=2).orders) == min(2, wanted)


def test_few_orders_share_the_probability_where_there_are_more(predictor: Predictor) -> None:
    whole = forecast(predictor, busy(), **ALL)
    found = forecast(predictor, busy(), mass=1.0, most=10_000, limit=10)
    assert found.feasible == len(found.orders) == 10
    assert found.left_out == whole.feasible - 10
    assert found.probability.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(found.orders[0], whole.orders[0])
    shares = np.array([by_order(whole)[tuple(order)] for order in found.orders.tolist()])
    np.testing.assert_allclose(found.probability, shares / shares.sum(), rtol=1e-9)
    missing = 1.0 - shares.sum()
    assert 0.0 < missing < 0.5
    assert abs(found.yielder_first - whole.yielder_first).max() <= missing + 1e-9


def test_no_limit_is_all_orders(predictor: Predictor) -> None:
    every, some = (forecast(predictor, busy(), **ALL, limit=limit) for limit in (None, 10_000))
    assert every.left_out == some.left_out == 0
    assert_same(every, some)
    assert forecast(predictor, busy(), limit=5).left_out > 0


def test_orders_left_out_are_those_that_change_the_most_certain_pairs(predictor: Predictor) -> None:
    """By brute force, against the order in which each pair, the most certain first, goes as is more probable."""
    cut = 0
    for seed in range(20):
        traffic, _ = random_case("bendplatz", 92_200 + seed)
        feasible = np.concatenate(list(crossing_orders(traffic)))
        if not 4 <= len(feasible) <= 500:
            continue
        logit = predictor.core_policy.evaluate_order(predictor.bound_to(BENDPLATZ).observe_orders(traffic.core))
        most_probable = feasible
        for pair in np.argsort(-abs(logit), kind="stable"):
            as_liked = most_probable[:, pair] == (1 if logit[pair] > 0 else -1)
            most_probable = most_probable[as_liked] if as_liked.any() else most_probable
        changed = np.where(feasible != most_probable[0], abs(logit), 0.0).max(axis=1)
        limit = int(np.random.default_rng(seed).integers(1, len(feasible)))
        found = forecast(predictor, traffic, **ALL, limit=limit)
        kept = (feasible[:, None] == found.orders).all(axis=2).any(axis=1)
        assert found.feasible == limit
        assert found.left_out == len(feasible) - limit
        assert changed[kept].max() <= changed[~kept & (changed > 0.0)].min(initial=np.inf) or kept.sum() < limit
        assert kept[(feasible == most_probable[0]).all(axis=1)].all()
        cut += kept.sum() == limit
    assert cut > 5


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"mass": 0.0}, "mass must be above 0 and at most 1, not 0"),
        ({"mass": 1.1}, "mass must be above 0 and at most 1"),
        ({"mass": float("nan")}, "mass must be above 0 and at most 1, not nan"),
        ({"most": 0}, "most must be at least 1, not 0"),
        ({"limit": 0}, "limit must be at least 1, not 0"),
    ],
)
def test_limits_out_of_range_are_refused(predictor: Predictor, limits: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        forecast(predictor, few(), **limits)


@pytest.mark.parametrize("seed", range(5))
def test_permuting_vehicles_permutes_the_forecast(predictor: Predictor, seed: int) -> None:
    traffic, _ = random_case("bendplatz", 92_000 + seed)
    order = np.random.default_rng(seed).permutation(len(traffic))
    fields = ("route", "position", "speed", "length", "width", "max_speed")
    arrays = (getattr(traffic, field)[order] for field in fields)
    permuted = Traffic(traffic.intersection, tuple(traffic.ids[i] for i in order), *arrays)
    one, other = forecast(predictor, traffic, **ALL), forecast(predictor, permuted, **ALL)

    def in_ids(found: Forecast) -> dict[frozenset[tuple[str, str]], float]:
        return {frozenset(found.traffic.words(row)): p for row, p in zip(found.orders, found.probability, strict=True)}

    assert in_ids(other) == {pairs: pytest.approx(p, abs=1e-9) for pairs, p in in_ids(one).items()}
    np.testing.assert_allclose(one.mean_position()[:, order], other.mean_position(), atol=1e-3)
    quantiles, permuted_ones = one.position_quantiles(LEVELS)[:, :, order], other.position_quantiles(LEVELS)
    assert (abs(quantiles - permuted_ones) < 1e-3).mean() > 0.99, "a tie of the sums of probabilities may go either way"


@pytest.mark.parametrize("seed", range(5))
def test_quantiles_rise_with_the_level_and_nobody_is_behind_where_it_is_now(predictor: Predictor, seed: int) -> None:
    traffic, _ = random_case("crossroads", 92_100 + seed)
    quantiles = forecast(predictor, traffic).position_quantiles(LEVELS)
    assert quantiles.shape == (len(LEVELS), 51, len(traffic))
    assert (np.diff(quantiles, axis=0) >= 0.0).all()
    assert (quantiles >= traffic.position).all()
    np.testing.assert_array_equal(quantiles[:, 0], np.tile(traffic.position, (len(LEVELS), 1)))
    assert (quantiles[-1, -1] > quantiles[0, -1]).all()


def test_without_a_spread_one_order_is_its_prediction_whatever_the_level() -> None:
    policy, _ = forecasting(np.random.default_rng(0), spread=NO_SPREAD)
    found = forecast(Predictor(policy, "sure"), busy(), most=1)
    for quantile in found.position_quantiles(LEVELS):
        np.testing.assert_array_equal(quantile, found.prediction.position[0])
    many = forecast(Predictor(policy, "sure"), busy(), most=40)
    ends = many.position_quantiles((0.0, 1.0))
    np.testing.assert_array_equal(ends[0], many.prediction.position.min(axis=0))
    np.testing.assert_array_equal(ends[1], many.prediction.position.max(axis=0))


def test_one_level_alone_is_a_level_too(predictor: Predictor) -> None:
    found = forecast(predictor, few())
    np.testing.assert_array_equal(found.position_quantiles(0.5), found.position_quantiles()[1:2])
    np.testing.assert_array_equal(found.time_loss_quantiles(0.5), found.time_loss_quantiles()[1:2])
    for level in (-0.1, 1.1, float("nan")):
        with pytest.raises(ValueError, match="levels must be a row of numbers from 0 to 1"):
            found.position_quantiles(level)


def quantile_by_hand(values: NDArray[np.float64], weight: NDArray[np.float64], level: float) -> float:
    """The first of the sorted values at which so much of the weight is reached."""
    reached = 0.0
    for k in np.argsort(values):
        reached += weight[k]
        if reached >= level:
            return float(values[k])
    return float(values.max())


def test_means_and_quantiles_over_the_orders_by_brute_force(predictor: Predictor) -> None:
    found = forecast(predictor, busy(), most=20)
    shares = found.probability / found.probability.sum()
    position, lost = (getattr(found.prediction, n).astype(np.float64) for n in ("position", "time_loss"))
    mean = sum(share * one for share, one in zip(shares, position, strict=True))
    np.testing.assert_allclose(found.mean_position(), mean, rtol=1e-12)
    np.testing.assert_allclose(found.expected_time_loss(), (shares[:, None] * lost).sum(axis=0), rtol=1e-12)
    quantiles = found.time_loss_quantiles((0.13, 0.5, 0.87))
    for vehicle in range(len(busy())):
        wanted = [quantile_by_hand(lost[:, vehicle], shares, level) for level in (0.13, 0.5, 0.87)]
        np.testing.assert_allclose(quantiles[:, vehicle], wanted)
    assert (lost.max(axis=0) > lost.min(axis=0) + 0.5).any()


def test_most_probable_is_the_prediction_of_the_first_order(predictor: Predictor) -> None:
    found = forecast(predictor, busy())
    alone = predictor.predict(busy(), found.orders[0])
    np.testing.assert_array_equal(found.most_probable().position, alone.position)
    np.testing.assert_array_equal(found.prediction.position[0], alone.position[0])


@pytest.mark.parametrize("vehicles", [[], [Vehicle("only", "W-E", 50.0, 5.0)]], ids=["nobody", "one"])
def test_traffic_without_conflicts_has_one_empty_order(predictor: Predictor, vehicles: list[Vehicle]) -> None:
    found = forecast(predictor, Traffic.of(T, vehicles))
    assert by_order(found) == {(): 1.0}
    assert (found.feasible, found.left_out) == (1, 0)
    assert found.yielder_first.shape == (0,)
    assert found.words() == ["nobody waits"]
    assert found.mean_position().shape == (51, len(vehicles))
    assert found.position_quantiles().shape == (3, 51, len(vehicles))
    assert found.time_loss_quantiles().shape == (3, len(vehicles))


@pytest.mark.parametrize("name", ["idm", "constant_velocity"])
def test_policy_without_an_order_network_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match=f'the policy "{name}" holds no order network; `python -m agents.orders`'):
        forecast(Predictor.load(name), few())


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_policies_forecast(name: str) -> None:
    found = forecast(Predictor.load(name), busy())
    assert 0.9 < found.probability.sum() <= 1.0 + 1e-12 or len(found.orders) == 64
    assert np.isfinite(found.position_quantiles(LEVELS)).all()


def test_far_vehicle_changes_no_probability(predictor: Predictor) -> None:
    far = Traffic.of(
        BENDPLATZ,
        [
            Vehicle("main", "SE-NW", 90.0, 12.0),
            Vehicle("side", "SW-NE", 75.0, 6.0),
            Vehicle("left", "NW-NE", 135.0, 6.0),
            Vehicle("far", "NW-SE", 318.0, 12.0),
        ],
    )
    one, other = forecast(predictor, few(), **ALL), forecast(predictor, far, **ALL)
    assert by_order(one) == by_order(other)
    np.testing.assert_array_equal(one.position_quantiles(), other.position_quantiles()[:, :, :3])


def test_forecast_is_frozen_and_survives_pickling(predictor: Predictor) -> None:
    found = forecast(predictor, few())
    with pytest.raises(FrozenInstanceError):
        found.probability = np.ones(1)  # type: ignore[misc]
    again = pickle.loads(pickle.dumps(found))
    assert_same(again, found)
    np.testing.assert_array_equal(again.position_quantiles(), found.position_quantiles())
    assert_same(forecast(pickle.loads(pickle.dumps(predictor)), few()), found)


def test_threads_change_no_byte(predictor: Predictor) -> None:
    assert_same(forecast(Predictor.load("idm_calibrated", threads=2), busy()), forecast(predictor, busy()))


BYTES = """
import hashlib
import numpy as np
from intersection_env import Predictor, forecast
from tests.support.twins import random_case

digest = hashlib.sha256()
for policy in ("idm_calibrated", "rollout_gradient"):
    for seed in range(10):
        found = forecast(Predictor.load(policy), random_case("bendplatz", 93_000 + seed)[0])
        parts = (found.orders, found.probability, found.yielder_first, found.position_quantiles())
        digest.update(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
print(digest.hexdigest())
"""


def test_v3_and_v4_give_the_same_bytes() -> None:
    if not {"v3", "v4"} <= set(_core.available_kernels()):
        pytest.skip("this machine has no AVX-512: there is nothing to compare")
    v3, v4 = (
        subprocess.run(
            [sys.executable, "-c", BYTES],
            env={**os.environ, "INTERSECTION_ENV_ISA": isa},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for isa in ("v3", "v4")
    )
    assert v3 == v4 != ""


def test_most_probable_order_goes_on_with_the_stops_that_were_made() -> None:
    route = BENDPLATZ.routes[BENDPLATZ.route_index("NE-SE")]
    predictor = Predictor.load()
    found = forecast(predictor, Traffic.of(BENDPLATZ, [Vehicle("stops", "NE-SE", route.stop_line - 12.0, 4.0)]))
    one, whole = found.most_probable(), predictor.predict(found.traffic)
    assert whole.waited is not None
    assert whole.waited.any(), "it made its stop"
    np.testing.assert_array_equal(one.waited, whole.waited)
    time = 0.2 * int(np.flatnonzero(whole.waited[0, :, 0])[0] + 3)
    np.testing.assert_array_equal(one.traffic_at(time).waited, whole.traffic_at(time).waited)
