"""Threads change nothing in a prediction, nor do callers at the same time, pickling and forking."""

from __future__ import annotations

import multiprocessing
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Prediction, Predictor, Traffic, crossing_orders, rank_maneuvers
from tests.support.busy_traffic import busy


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
