"""Order features, probabilities and quantiles: the twin by hand, and the core as the twin."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, _core, forecast
from intersection_env.constants import STEPS
from intersection_env.maps.intersection import MAPS
from tests.reference import predictor as reference
from tests.support.forecasts import forecasting, random_spread
from tests.support.placing import T_JUNCTION, place
from tests.support.twins import CASES, as_traffic, random_case, twin_map

SHIPPED = sorted(path.stem for path in MAPS.glob("*.map"))
MOST_PAIRS = 12  # so that all orientations can be tried
ALL = 10_000


def test_features_of_a_pair_by_hand() -> None:
    """Twice the same yielder, of whom the second queues behind; the foe yields to nobody."""
    traffic = place(T_JUNCTION, ("S-W", 1.5, 2.0), ("S-W", 9.5, 3.0), ("W-E", 40.0, 10.0), ("E-W", 200.0, 8.0))
    conflicts = reference.conflicts(T_JUNCTION, traffic).tolist()
    assert conflicts == [[0, 2], [0, 3], [1, 2], [1, 3]]
    first, second, third, _ = reference.order_features(T_JUNCTION, traffic)
    conflict = reference.conflict_of(T_JUNCTION, traffic, 0, 2)
    assert conflict is not None
    route, line = T_JUNCTION.routes[traffic.route[0]], T_JUNCTION.routes[traffic.route[2]].stop_line
    to_conflict = conflict.begin_prioritized - (line - 40.0)
    own = [conflict.begin_yielder - (route.stop_line - 1.5), conflict.end_yielder - (route.stop_line - 5.5), 1.5, 2.0]
    np.testing.assert_allclose(first[:4], own)
    assert first[5:8].tolist() == [100.0, pytest.approx(100 / 3.6), 4.0]
    assert third[5:8].tolist() == [pytest.approx(4.0), 2.0, 4.0]
    assert first[8] == pytest.approx(to_conflict)
    assert first[16:].tolist() == [float(conflict.merging), 12.0, 1.0, 12.0, 0.0]
    assert second[17] == pytest.approx(to_conflict / 10.0)


def test_one_pair_is_as_probable_as_its_logit_says_unless_one_can_no_longer_stop() -> None:
    logit = np.array([0.7])
    free = place(T_JUNCTION, ("E-S", 30, 8), ("W-E", 30, 8))
    shares = reference.probabilities(T_JUNCTION, free, logit)
    assert shares == {(1,): pytest.approx(1 / (1 + np.exp(-0.7))), (-1,): pytest.approx(1 / (1 + np.exp(0.7)))}
    assert reference.yielder_first(shares, logit).tolist() == [shares[1,]]
    late = place(T_JUNCTION, ("E-S", 5, 8), ("W-E", 30, 8))
    assert reference.probabilities(T_JUNCTION, late, logit) == {(1,): 1.0}
    both = place(T_JUNCTION, ("E-S", 5, 8), ("W-E", 5, 8))
    shares = reference.probabilities(T_JUNCTION, both, logit)
    assert shares == {(0,): 1.0}
    assert reference.yielder_first(shares, logit)[0] == pytest.approx(1 / (1 + np.exp(-0.7)))


@pytest.mark.parametrize("name", SHIPPED)
def test_features_and_logits_equal_the_twin(name: str) -> None:
    pairs = 0
    for seed in range(40 * CASES):
        traffic, twin = random_case(name, 90_000 + seed)
        policy, network = forecasting(np.random.default_rng(seed))
        predictor = Predictor(policy, "test")
        features = predictor.bound_to(traffic.intersection).observe_orders(traffic.core)
        truth = reference.order_features(twin_map(name), twin)
        np.testing.assert_allclose(features, truth, atol=2e-3)
        logits = predictor.core_policy.evaluate_order(features)
        np.testing.assert_allclose(logits, reference.logits(twin_map(name), twin, network), atol=1e-3)
        pairs += len(features)
    assert pairs > 150 * CASES


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("is_given", [False, True])
def test_probabilities_equal_those_of_all_orders_by_brute_force(name: str, is_given: bool) -> None:
    compared = conditions = 0
    for seed in range(50 * CASES):
        traffic, twin = random_case(name, 91_000 + seed)
        if len(traffic.conflicts) > MOST_PAIRS:
            continue
        generator = np.random.default_rng(seed)
        predictor = Predictor(forecasting(generator)[0], "test")
        bound = predictor.bound_to(traffic.intersection)
        logits = predictor.core_policy.evaluate_order(bound.observe_orders(traffic.core)).astype(np.float64)
        given = np.zeros(len(traffic.conflicts), np.int8)
        if is_given:
            some = list(reference.orders(twin_map(name), twin) or {tuple(given.tolist())})
            is_held = generator.random(len(given)) < 0.4
            given = np.where(is_held, np.array(some[int(generator.integers(len(some)))], np.int8), np.int8(0))
        truth = reference.probabilities(twin_map(name), twin, logits, given.astype(np.int64))
        orders, probability, first, feasible, left_out = _core.order_probabilities(
            bound, traffic.core, given, 1.0, ALL, ALL
        )
        assert (feasible, left_out) == (len(truth), 0)
        found = dict(zip(map(tuple, orders.tolist()), probability.tolist(), strict=True))
        assert found == {order: pytest.approx(truth[order], abs=1e-9) for order in found}
        assert sum(found.values()) == pytest.approx(1.0, abs=1e-12)
        assert sum(share for order, share in truth.items() if order not in found) < 1e-12
        np.testing.assert_allclose(first, reference.yielder_first(truth, logits), atol=1e-9)
        compared += len(truth) > 1
        conditions += bool(given.any())
    assert compared > 10 * CASES
    assert not is_given or conditions > 10 * CASES


@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_given_is_refused_where_the_twin_refuses_it(name: str) -> None:
    refused = 0
    for seed in range(40 * CASES):
        traffic, twin = random_case(name, 91_000 + seed)
        if len(traffic.conflicts) > MOST_PAIRS:
            continue
        generator = np.random.default_rng(seed)
        bound = Predictor(forecasting(generator)[0], "test").bound_to(traffic.intersection)
        given = generator.choice(np.array([-1, 0, 1], np.int8), len(traffic.conflicts))
        try:
            reference.complete(twin_map(name), twin, given.astype(np.int64))
        except ValueError:
            with pytest.raises(ValueError, match=r"cannot go before|can no longer stop"):
                _core.order_probabilities(bound, traffic.core, given, 1.0, ALL, ALL)
            refused += 1
        else:
            _core.order_probabilities(bound, traffic.core, given, 1.0, ALL, ALL)
    assert refused > 5 * CASES


def test_where_no_order_is_feasible_all_is_left_to_the_gap_decision() -> None:
    """Of each of two lanes the second vehicle can no longer stop, so it goes before the first one of the other lane."""
    lanes = [(route, before, speed) for route in ("W-E", "S-W") for before, speed in ((2.0, 1.0), (8.5, 9.0))]
    twin = place(T_JUNCTION, *lanes)
    assert len(reference.conflicts(T_JUNCTION, twin)) == 4
    assert reference.orders(T_JUNCTION, twin) == set()
    predictor = Predictor(forecasting(np.random.default_rng(0))[0], "test")
    traffic = as_traffic(Intersection.load("t_junction"), twin)
    found = forecast(predictor, traffic)
    logits = predictor.core_policy.evaluate_order(
        predictor.bound_to(traffic.intersection).observe_orders(traffic.core)
    ).astype(np.float64)
    truth = reference.probabilities(T_JUNCTION, twin, logits)
    assert {tuple(row) for row in found.orders.tolist()} == truth.keys() == {(0, 0, 0, 0)}
    assert found.probability.tolist() == [1.0]
    np.testing.assert_allclose(found.yielder_first, reference.yielder_first(truth, logits))
    np.testing.assert_array_equal(found.prediction.position, predictor.predict(traffic).position)


@pytest.mark.parametrize("seed", range(3 * CASES))
def test_position_quantiles_equal_plain_numpy(seed: int) -> None:
    generator = np.random.default_rng(seed)
    spread = random_spread(generator)
    policy, _ = forecasting(generator, spread=spread)
    orders, vehicles = 3, 2
    steps = generator.uniform(0.0, (0.0, 3.0), (orders, STEPS, vehicles)).cumsum(axis=1)  # the first one stands
    position = 20.0 + np.concatenate([np.zeros((orders, 1, vehicles)), steps], axis=1)
    position = position.astype(np.float32)
    probability = generator.dirichlet(np.ones(orders))
    levels = np.array([0.0, 0.07, 0.5, 0.731, 1.0])
    found = _core.position_quantiles(
        _core.Policy(policy.text(), "test"), probability, np.ascontiguousarray(position), levels
    )
    scale, shape = (part.astype(np.float64) for part in (spread.scale, spread.shape))
    truth = reference.position_quantiles(scale, shape, probability, position.astype(np.float64), levels)
    np.testing.assert_allclose(found, truth, atol=1e-3)
    assert (found[2, 1:] != found[2, :1]).any()
