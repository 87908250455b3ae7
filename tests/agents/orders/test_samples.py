"""What an order network learns from: features as the core sees them, all feasible orders, and what was recorded."""

from __future__ import annotations

import numpy as np
import pytest

from agents.orders import samples as module
from agents.orders.samples import OrderSample, order_samples
from intersection_env import Scenes, crossing_orders
from intersection_env.evaluation.moments import SCORED, Moment, contested, moments_of
from intersection_env.evaluation.recorded_order import recorded_order, scored_order
from tests.reference import predictor as reference
from tests.support.scenes import small_scenes
from tests.support.twins import twin_map

EVERY = 2.0


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train", each=4)


@pytest.fixture(scope="module")
def moments(scenes: Scenes) -> list[Moment]:
    return contested(moments_of(scenes, EVERY)[0])


def usable(moments: list[Moment]) -> list[Moment]:
    """Those of whose pairs an order is known that is feasible."""
    found = []
    for moment in moments:
        orders = np.concatenate(
            [np.zeros((0, len(moment.traffic.conflicts)), np.int8), *crossing_orders(moment.traffic)]
        )
        known, _ = scored_order(moment)
        sample = OrderSample(np.zeros((0, 21), np.float32), orders, known)
        if known.any() and len(orders) <= module.MOST_ORDERS and sample.possible.any():
            found.append(moment)
    return found


def test_samples_are_features_orders_and_the_recorded_order_of_each_moment(
    scenes: Scenes, moments: list[Moment]
) -> None:
    samples, left_out = order_samples(scenes, "train", EVERY)
    of_moments = usable(moments)
    assert len(samples) == len(of_moments) > 20
    assert len(samples) + sum(left_out.values()) == len(moments)
    for sample, moment in zip(samples, of_moments, strict=True):
        traffic = moment.traffic
        floats = (
            getattr(traffic, name).astype(np.float64) for name in ("position", "speed", "length", "width", "max_speed")
        )
        twin = reference.Traffic(traffic.route.astype(np.int64), *floats)
        np.testing.assert_allclose(sample.features, reference.order_features(twin_map("bendplatz"), twin), atol=2e-3)
        feasible = {tuple(row) for batch in crossing_orders(traffic) for row in batch.tolist()}
        assert {tuple(row) for row in sample.orders.tolist()} == feasible
        assert len(sample.orders) == len(feasible)
        np.testing.assert_array_equal(sample.recorded, scored_order(moment)[0])


def test_pairs_with_a_bicycle_are_not_scored(moments: list[Moment]) -> None:
    bicycles = cars = 0
    for moment in moments:
        (known, _), (recorded, _) = scored_order(moment), recorded_order(moment)
        users = [track.road_user for track in moment.tracks()]
        for pair, (i, j) in enumerate(moment.traffic.conflicts.tolist()):
            scored = users[i] in SCORED and users[j] in SCORED
            assert known[pair] == (recorded[pair] if scored else 0)
            bicycles += not scored and recorded[pair] != 0
            cars += scored and recorded[pair] != 0
    assert bicycles > 0
    assert cars > 0


def test_possible_orders_are_those_that_contradict_nothing_recorded() -> None:
    orders = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], np.int8)
    for recorded, possible in (
        ([1, 0, 0], [True, True, False, False]),
        ([1, -1, 0], [False, True, False, False]),
        ([0, 0, 0], [True] * 4),
        ([0, 1, -1], [True, False, True, False]),
    ):
        sample = OrderSample(np.zeros((3, 21), np.float32), orders, np.array(recorded, np.int8))
        assert sample.possible.tolist() == possible


def test_moments_of_too_many_orders_are_left_out_and_counted(
    scenes: Scenes, moments: list[Moment], monkeypatch: pytest.MonkeyPatch
) -> None:
    all_samples, before = order_samples(scenes, "train", EVERY)
    monkeypatch.setattr(module, "MOST_ORDERS", 3)
    few, after = order_samples(scenes, "train", EVERY)
    assert 0 < len(few) < len(all_samples)
    assert max(len(sample.orders) for sample in few) <= 3
    reason = "more orders than learned from"
    assert after[reason] > before[reason]
    assert len(few) + sum(after.values()) == len(moments)


def test_scenes_without_an_open_pair_of_known_order_are_refused() -> None:
    with pytest.raises(ValueError, match='no moment of split "train" with an open pair of which it is known'):
        order_samples(small_scenes("development", each=1), "train")
