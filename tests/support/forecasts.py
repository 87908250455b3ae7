"""Policies that forecast, with an order network and a spread of no training; and forecasts of few vehicles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from intersection_env import Forecast, Traffic, Vehicle
from intersection_env.policies.file import PolicyFile, Spread
from tests.reference import predictor as reference
from tests.support.busy_traffic import BENDPLATZ
from tests.support.core_and_twin import weights
from tests.support.twins import random_order_network

SECONDS, WAYS, LEVELS = 10, 5, 19
NO_SPREAD = Spread(np.zeros((SECONDS, WAYS), np.float32), np.zeros((SECONDS, LEVELS), np.float32))


def random_spread(generator: np.random.Generator) -> Spread:
    """A spread of a trained one's size, another for each second and way."""
    scale = generator.uniform(0.1, 4.0, (SECONDS, WAYS)).astype(np.float32)
    return Spread(scale, np.sort(generator.normal(0.0, 1.5, (SECONDS, LEVELS)), axis=1).astype(np.float32))


def forecasting(
    generator: np.random.Generator, policy: PolicyFile | None = None, spread: Spread | None = None
) -> tuple[PolicyFile, reference.Network]:
    """The policy, by default the IDM with critical gaps, with random forecasts; and its order network for the twin."""
    network = random_order_network(generator)
    plain = PolicyFile("critical_gap", "idm") if policy is None else policy
    spread = random_spread(generator) if spread is None else spread
    return replace(plain, order_network=weights(network), spread=spread), network


def few() -> Traffic:
    """Three vehicles, three pairs."""
    vehicles = [
        Vehicle("main", "SE-NW", 90.0, 12.0),
        Vehicle("side", "SW-NE", 75.0, 6.0),
        Vehicle("left", "NW-NE", 135.0, 6.0),
    ]
    return Traffic.of(BENDPLATZ, vehicles)


def by_order(found: Forecast) -> dict[tuple[int, ...], float]:
    return dict(zip(map(tuple, found.orders.tolist()), found.probability.tolist(), strict=True))


def assert_same(one: Forecast, other: Forecast) -> None:
    for name in ("orders", "probability", "yielder_first", "order", "weight"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    for name in ("position", "speed", "acceleration", "enters", "present", "time_loss", "minimum_distance"):
        np.testing.assert_array_equal(getattr(one.prediction, name), getattr(other.prediction, name), name)
    assert (one.feasible, one.left_out) == (other.feasible, other.left_out)
