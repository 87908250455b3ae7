"""The spread of drivers: what it is measured from it covers, and it is that of whoever drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.networks.order import OrderNetwork
from agents.orders import spread as module
from agents.orders.spread import EVERY, LEVELS, spread_of
from agents.orders.train import with_forecast
from intersection_env import Predictor, Scenes, _core
from intersection_env.evaluation.moments import followed, moments_of
from intersection_env.evaluation.recorded_order import recorded_order
from intersection_env.policies.file import PolicyFile, Spread
from intersection_env.policies.named import policy_named
from tests.support.forecasts import forecasting
from tests.support.scenes import small_scenes

SEED = 0
DRAWN = 60_000


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("development", each=6)


def scale_of(second: NDArray[np.int64], way: NDArray[np.float64]) -> NDArray[np.float64]:
    """[m], planted: it grows with the time and with the way."""
    return 0.3 * second * (1.0 + way / 40.0)


def units(generator: np.random.Generator, count: int) -> NDArray[np.float64]:
    """In units of that scale: more are a little behind, and a few far ahead."""
    return 0.5 * (generator.gamma(4.0, 1.0, count) - 4.0)


def drawn(generator: np.random.Generator) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Seconds, ways and distances of drivers."""
    second, way = generator.integers(1, 11, DRAWN), generator.uniform(0.0, 80.0, DRAWN)
    return second, way, scale_of(second, way) * units(generator, DRAWN)


def distance_at(spread: Spread, second: int, way: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """The quantile of the distance [m]."""
    scale: NDArray[np.float64] = np.interp(way, np.array(_core.spread_ways()), spread.scale[second - 1])
    return scale * float(np.interp(level, LEVELS, spread.shape[second - 1]))


def test_intervals_cover_what_is_drawn_with_a_known_spread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_distances", lambda *_: drawn(np.random.default_rng(SEED)))
    spread = spread_of(PolicyFile("critical_gap", "idm"), [])
    second, way, distance = drawn(np.random.default_rng(SEED + 1))
    for k in range(1, 11):
        for low, high in ((0.0, 15.0), (15.0, 40.0), (40.0, 80.0)):
            own = (second == k) & (way >= low) & (way < high)
            for level in (0.1, 0.5, 0.9):
                below = (distance[own] <= distance_at(spread, k, way[own], level)).mean()
                assert below == pytest.approx(level, abs=0.05), (k, low, level)
    assert (np.diff(spread.shape, axis=1) >= 0.0).all()


def test_forecast_covers_what_is_drawn_with_a_known_spread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the core, of a car that is predicted to go 6 m/s."""
    monkeypatch.setattr(module, "_distances", lambda *_: drawn(np.random.default_rng(SEED)))
    spread = spread_of(PolicyFile("critical_gap", "idm"), [])
    policy, _ = forecasting(np.random.default_rng(0), spread=spread)
    position = (20.0 + 6.0 * 0.2 * np.arange(51, dtype=np.float32)).reshape(1, 51, 1)
    core = _core.Policy(policy.text(), "test")
    low, high = _core.position_quantiles(core, np.ones(1), position, np.array([0.1, 0.9]))[:, :, 0]
    generator = np.random.default_rng(SEED + 2)
    for second in range(1, 11):
        distance = scale_of(np.array([second]), np.array([6.0 * second])) * units(generator, 5000)
        truth = position[0, 5 * second, 0] + distance
        covered = ((truth >= low[5 * second]) & (truth <= high[5 * second])).mean()
        assert covered == pytest.approx(0.8, abs=0.05), second


def test_intervals_cover_the_recordings_that_they_are_measured_from(scenes: Scenes) -> None:
    policy, _ = policy_named("idm_calibrated")
    spread, predictor = spread_of(policy, scenes), Predictor(policy, "test")
    inside, counted = np.zeros(11), np.zeros(11)
    for moment in followed(moments_of(scenes, EVERY)[0]):
        order, _ = recorded_order(moment)
        try:
            predicted = predictor.predict(moment.traffic, order).position[0]
        except ValueError:
            continue
        known = [
            not (order[(moment.traffic.conflicts == i).any(axis=1)] == 0).any() for i in range(len(moment.traffic))
        ]
        for second in range(1, 11):
            seen = moment.scored[0] & moment.scored[5 * second] & known
            way = (predicted[5 * second] - predicted[0])[seen].astype(np.float64)
            low, high = (distance_at(spread, second, way, level) for level in (0.1, 0.9))
            distance = (moment.recorded.data[5 * second] - predicted[5 * second])[seen]
            inside[second] += ((distance >= low - 1e-4) & (distance <= high + 1e-4)).sum()
            counted[second] += seen.sum()
    assert (counted[1:] > 100).all()
    np.testing.assert_allclose(inside[1:] / counted[1:], 0.8, atol=0.02)


def test_ways_that_hardly_anybody_goes_have_the_scale_of_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(0)
    way = generator.uniform(5.0, 15.0, 1000)
    monkeypatch.setattr(module, "_distances", lambda *_: (np.full(1000, 3), way, generator.normal(0.0, 2.0, 1000)))
    spread = spread_of(PolicyFile("critical_gap", "idm"), [])
    assert spread.scale[2, 0] == spread.scale[2, 1]
    assert spread.scale[2, 2] == spread.scale[2, 3] == spread.scale[2, 4]
    assert spread.scale[2] == pytest.approx(2.0, rel=0.1)
    assert (spread.scale[0] == np.float32(module.LEAST_SCALE)).all(), "a second at which nobody is seen"
    assert (spread.shape[0] == 0.0).all()


def test_spread_is_that_of_its_own_drivers(scenes: Scenes) -> None:
    """A policy that had forecasts gets those of who drives now, whatever it held before."""
    idm, network = policy_named("idm_calibrated")[0], OrderNetwork()
    plain = replace(idm, order_network=None, spread=None)
    made, again = (with_forecast(policy, network, scenes, {"made_by": "a test"}) for policy in (idm, plain))
    assert made.text() == again.text()
    assert made.spread is not None
    assert idm.spread is not None
    assert not np.array_equal(made.spread.scale, idm.spread.scale)
    other = with_forecast(policy_named("gap")[0], network, scenes, {})
    assert other.spread is not None
    assert not np.array_equal(made.spread.scale, other.spread.scale)
    assert made.about == {**idm.about, "orders": {"made_by": "a test"}}


def test_scenes_in_which_nobody_can_be_measured_are_refused(scenes: Scenes) -> None:
    with pytest.raises(ValueError, match='nobody to measure a spread by in the scenes of split "validation"'):
        spread_of(PolicyFile("critical_gap", "idm"), scenes, "validation")
