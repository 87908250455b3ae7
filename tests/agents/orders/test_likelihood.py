"""The likelihood of recorded orders equals brute force, and what is learned by it is what the core says."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from agents.networks.export import network_weights
from agents.networks.order import OrderNetwork
from agents.orders.likelihood import OrderBatch
from agents.orders.samples import OrderSample
from agents.orders.train import OrderSettings, scores, train_network
from intersection_env import Predictor, crossing_orders, forecast
from intersection_env.features import ORDER_FEATURES
from intersection_env.policies.file import PolicyFile
from tests.support.forecasts import NO_SPREAD
from tests.support.twins import random_case

INPUTS = len(ORDER_FEATURES)


def sample_of(generator: np.random.Generator, pairs: int, undecided: bool) -> OrderSample:
    """Some orientations of some pairs, of which one came true, as far as it is known."""
    all_orders = np.array(list(itertools.product((-1, 1), repeat=pairs)), np.int8)
    orders = generator.permutation(all_orders)[: max(1, int(generator.integers(len(all_orders) + 1)))]
    recorded = np.where(generator.random(pairs) < 0.7, orders[0], np.int8(0))
    if undecided:
        orders = orders.copy()
        orders[:, 0] = 0
        orders = np.unique(orders, axis=0)
    features = generator.normal(0.0, 20.0, (pairs, INPUTS)).astype(np.float32)
    return OrderSample(features, orders, recorded)


def sigmoid(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x))


def weights_of(sample: OrderSample, logit: NDArray[np.float64]) -> list[float]:
    """Of each order, the product of its pairs' probabilities."""
    return [
        math.prod(sigmoid(way * x) for way, x in zip(order, logit, strict=True) if way)
        for order in sample.orders.tolist()
    ]


def loss_by_hand(sample: OrderSample, logit: NDArray[np.float64]) -> float:
    weights = weights_of(sample, logit)
    agree = sum(
        weight
        for weight, order in zip(weights, sample.orders.tolist(), strict=True)
        if all(way in (0, seen) or seen == 0 for way, seen in zip(order, sample.recorded.tolist(), strict=True))
    )
    alone = sum(
        math.log(sigmoid(seen * x))
        for pair, (seen, x) in enumerate(zip(sample.recorded.tolist(), logit, strict=True))
        if seen and not sample.orders[:, pair].any()
    )
    return -math.log(agree / sum(weights)) - alone


def batch_of(seed: int) -> tuple[list[OrderSample], torch.Tensor, list[NDArray[np.float64]]]:
    generator = np.random.default_rng(seed)
    samples = [sample_of(generator, int(generator.integers(1, 5)), bool(k % 2)) for k in range(8)]
    logits = [generator.normal(0.0, 2.0, len(sample.recorded)) for sample in samples]
    padded = torch.zeros(len(samples), max(map(len, logits)), dtype=torch.float32)
    for row, logit in enumerate(logits):
        padded[row, : len(logit)] = torch.from_numpy(logit)
    return samples, padded, logits


@pytest.mark.parametrize("seed", range(4))
def test_loss_is_the_negative_log_likelihood_by_brute_force(seed: int) -> None:
    samples, padded, logits = batch_of(seed)
    truth = np.mean([loss_by_hand(sample, logit) for sample, logit in zip(samples, logits, strict=True)])
    assert float(OrderBatch.of(samples).loss(padded)) == pytest.approx(truth, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_probability_of_a_pair_is_that_of_the_orders_in_which_its_yielder_goes_first(seed: int) -> None:
    samples, padded, logits = batch_of(seed)
    found = OrderBatch.of(samples).probability(padded).numpy()
    for row, (sample, logit) in enumerate(zip(samples, logits, strict=True)):
        share = np.array(weights_of(sample, logit)) / sum(weights_of(sample, logit))
        for pair, x in enumerate(logit):
            of_pair = sample.orders[:, pair]
            truth = share @ np.where(of_pair == 0, sigmoid(x), of_pair > 0)
            assert found[row, pair] == pytest.approx(truth, abs=1e-5)


def test_core_says_of_each_pair_what_the_training_does() -> None:
    network = OrderNetwork()
    policy = replace(PolicyFile("critical_gap", "idm"), order_network=network_weights(network), spread=NO_SPREAD)
    predictor = Predictor(policy, "test")
    pairs = 0
    for seed in range(30):
        traffic, _ = random_case("bendplatz", 94_000 + seed)
        orders = np.concatenate(list(crossing_orders(traffic)))
        if len(orders) > 500 or not len(traffic.conflicts):
            continue
        features = predictor.bound_to(traffic.intersection).observe_orders(traffic.core)
        batch = OrderBatch.of([OrderSample(features, orders, np.zeros(len(features), np.int8))])
        with torch.no_grad():
            truth = batch.probability(network(batch.features))[0].numpy()
        np.testing.assert_allclose(forecast(predictor, traffic).yielder_first, truth, atol=1e-5)
        pairs += len(truth)
    assert pairs > 60


def planted(count: int, seed: int) -> list[OrderSample]:
    """Two pairs that share a vehicle; whichever foe is nearer than 20 m goes first, whatever else is seen."""
    generator = np.random.default_rng(seed)
    column = ORDER_FEATURES.index("foe_distance_to_conflict_m")
    orders = np.array([[1, 1], [1, -1], [-1, -1]], np.int8)
    samples: list[OrderSample] = []
    while len(samples) < count:
        features = generator.normal(10.0, 10.0, (2, INPUTS)).astype(np.float32)
        features[:, column] = generator.uniform(0.0, 40.0, 2)
        recorded = np.where(features[:, column] > 20.0, 1, -1).astype(np.int8)
        if (orders == recorded).all(axis=1).any():
            samples.append(OrderSample(features, orders, recorded))
    return samples


def test_planted_order_is_learned() -> None:
    settings = OrderSettings(epochs=25, batch=64)
    network = train_network(planted(1500, 0), planted(200, 1), settings, progress=False)
    found, before = scores(network, planted(200, 2)), scores(OrderNetwork(), planted(200, 2))
    assert found["accuracy"] > 0.95 > before["accuracy"]
    assert found["log_loss"] < 0.15 < before["log_loss"]


def test_scores_of_a_network_that_knows_nothing_and_of_orders_that_are_sure() -> None:
    network = OrderNetwork()
    torch.nn.init.zeros_(network.last.weight)
    torch.nn.init.zeros_(network.last.bias)
    features = np.zeros((1, INPUTS), np.float32)
    both = np.array([[1], [-1]], np.int8)
    open_one, sure = (OrderSample(features, orders, np.array([-1], np.int8)) for orders in (both, both[1:]))
    unknown = replace(open_one, recorded=np.zeros(1, np.int8))
    assert scores(network, [open_one, unknown]) == {
        "accuracy": 1.0,
        "log_loss": pytest.approx(math.log(2.0)),
        "brier": pytest.approx(0.25),
    }
    assert scores(network, [sure])["brier"] == pytest.approx(0.0, abs=1e-9)
