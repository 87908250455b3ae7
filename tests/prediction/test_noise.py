"""Forecasts of traffic that errs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from intersection_env import Intersection, Noise, Predictor, Traffic, Vehicle, forecast
from tests.support.busy_traffic import T, busy
from tests.support.forecasts import assert_same, by_order, few


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor.load("idm_calibrated")


def test_noise_of_zero_is_none(predictor: Predictor) -> None:
    """But that each draw has its scenarios."""
    plain, noisy = (forecast(predictor, few(), noise=n) for n in (None, Noise(0.0, 0.0, draws=3)))
    assert by_order(noisy) == {order: pytest.approx(p, rel=1e-12) for order, p in by_order(plain).items()}
    assert (np.diff(noisy.probability) <= 0.0).all()
    np.testing.assert_allclose(noisy.yielder_first, plain.yielder_first, rtol=1e-12)
    assert len(noisy.weight) == 3 * len(plain.weight)
    assert noisy.weight.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(noisy.mean_position(), plain.mean_position(), rtol=1e-9)
    np.testing.assert_allclose(noisy.expected_time_loss(), plain.expected_time_loss(), rtol=1e-9)
    for scenario, order in enumerate(noisy.order.tolist()):
        alone = predictor.predict(few(), noisy.orders[order])
        np.testing.assert_array_equal(noisy.prediction.position[scenario], alone.position[0])


def test_noise_repeats_with_its_seed_and_spreads_what_is_probable(predictor: Predictor) -> None:
    one, two, other = (forecast(predictor, busy(), noise=Noise(draws=4, seed=seed)) for seed in (3, 3, 4))
    assert_same(one, two)
    assert one.prediction.position.tobytes() != other.prediction.position.tobytes()
    scatter = one.prediction.position[:, 0].std(axis=0)
    assert (scatter > 0.05).all()
    assert (scatter < 2.0).all()
    assert one.probability.sum() <= 1.0 + 1e-12
    assert set(one.order.tolist()) == set(range(len(one.orders)))


def nearly_past() -> Traffic:
    """The yielder's rear is 5 cm before its point of guaranteed arrival: with noise their pair is open, or over."""
    conflict = next(
        one for one in T.conflicts if (one.yielder, one.prioritized) == (T.route_index("S-W"), T.route_index("W-E"))
    )
    past = Vehicle("past", "S-W", conflict.on_yielder[1] - 0.05 + 2.25, 8.0)
    line = T.routes[T.route_index("E-S")].stop_line
    return Traffic.of(T, [past, Vehicle("main", "W-E", 80.0, 10.0), Vehicle("left", "E-S", line - 25.0, 8.0)])


def test_pairs_of_a_draw_are_mapped_to_those_of_the_traffic(predictor: Predictor) -> None:
    """A pair that is over in a draw has gone as it has gone; the others keep their places."""
    traffic = nearly_past()
    pairs = traffic.conflicts.tolist()
    assert [0, 1] in pairs
    assert [2, 1] in pairs
    gone, open_pair = pairs.index([0, 1]), pairs.index([2, 1])
    plain = forecast(predictor, traffic)
    assert (plain.orders[:, gone] == 1).all()
    noisy = forecast(predictor, traffic, noise=Noise(0.3, 0.0, draws=16))
    assert (noisy.orders[:, gone] == 1).all(), "over in some draws, open in others"
    assert len(np.unique(noisy.orders, axis=0)) == len(noisy.orders)
    assert noisy.yielder_first[gone] == pytest.approx(1.0)
    assert set(noisy.orders[:, open_pair].tolist()) == {-1, 1}
    assert noisy.yielder_first[open_pair] == pytest.approx(plain.yielder_first[open_pair], abs=0.15)
    likely = np.flatnonzero(noisy.order == 0)
    drawn = noisy.prediction.position[likely[noisy.weight[likely].argmax()]]
    np.testing.assert_array_equal(noisy.most_probable().position[0], drawn)


def test_most_probable_order_of_noisy_draws_need_not_be_possible_in_the_traffic() -> None:
    vehicles = [
        Vehicle("v0", "W-E", 155.46024078991627, 13.6422397),
        Vehicle("v1", "W-S", 84.11523907, 5.98180875),
        Vehicle("v2", "S-E", 86.35887054623292, 8.67839467),
    ]
    traffic = Traffic.of(Intersection.load("t_junction"), vehicles)
    found = forecast(Predictor.load(), traffic, noise=Noise(draws=4, seed=5))
    assert np.isfinite(found.most_probable().position).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"position": -0.1}, "position must be a deviation from 0 on, not -0.1"),
        ({"speed": float("nan")}, "speed must be a deviation from 0 on, not nan"),
        ({"position": "a"}, "position must be a deviation from 0 on, not 'a'"),
        ({"draws": 0}, "draws must be at least 1, not 0"),
        ({"seed": -1}, "seed must not be negative, not -1"),
    ],
)
def test_noise_that_is_none_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Noise(**wrong)


def test_what_is_given_holds_in_every_draw(predictor: Predictor) -> None:
    found = forecast(predictor, few(), [("side", "main")], noise=Noise(draws=4))
    pair = few().conflicts.tolist().index([1, 0])
    assert (found.orders[:, pair] == 1).all()
    assert found.yielder_first[pair] == pytest.approx(1.0)


def test_noise_by_which_no_traffic_can_be_is_refused(predictor: Predictor) -> None:
    """Ten cars bumper to bumper, each where it is to ten metres."""
    queue = Traffic.of(T, [Vehicle(f"q{k}", "W-E", 20.0 + 5.0 * k, 0.0) for k in range(10)])
    with pytest.raises(ValueError, match=r"no traffic with such noise in 100 draws; of the last one: .*overlap"):
        forecast(predictor, queue, noise=Noise(position=10.0, draws=1))


@pytest.mark.parametrize("vehicles", [[], [Vehicle("only", "W-E", 50.0, 5.0)]], ids=["nobody", "one"])
def test_traffic_without_conflicts_has_one_empty_order_in_every_draw(
    predictor: Predictor, vehicles: list[Vehicle]
) -> None:
    noisy = forecast(predictor, Traffic.of(T, vehicles), noise=Noise(draws=2))
    assert by_order(noisy) == {(): 1.0}


def test_draws_do_not_doubt_speeds(predictor: Predictor, recwarn: pytest.WarningsRecorder) -> None:
    """A traffic whose speeds are doubted says so itself; errors make some of others faster than that."""
    fast = Traffic.of(
        T, [Vehicle("a", T.routes[0].id, 10.0, 2.0 * float(T.sample(0, np.array([10.0], np.float32))[0, 4]))]
    )
    assert not recwarn.list
    forecast(predictor, fast, noise=Noise(0.0, 2.0, draws=8))
    assert not recwarn.list
