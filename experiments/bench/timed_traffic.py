"""What the predictor is timed with: traffics of 15 vehicles and networks of random weights."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from intersection_env import Intersection, Traffic, Vehicle, _core
from intersection_env.policies.file import NetworkWeights, PolicyFile

VEHICLES = (
    ("NW-SE", 100.0, 11.0),
    ("NW-SE", 125.0, 11.0),
    ("NW-SE", 75.0, 12.0),
    ("NW-SW", 60.0, 12.0),
    ("NW-NE", 148.0, 1.0),
    ("SE-NW", 110.0, 11.0),
    ("SE-NW", 85.0, 12.0),
    ("SE-NE", 60.0, 12.0),
    ("SE-NW", 40.0, 12.0),
    ("NE-NW", 83.0, 0.0),
    ("SE-NE", 76.0, 11.0),
    ("NE-SW", 68.0, 1.0),
    ("SW-SE", 82.0, 0.0),
    ("SW-SE", 74.0, 1.0),
    ("SW-SE", 60.0, 4.0),
)
"""(route, position [m], speed [m/s]): 15 vehicles with 25 open pairs on Bendplatz, the size the paper times."""
COUNTED = 4000  # orders, at most


def traffic(vehicles: int = len(VEHICLES)) -> Traffic:
    """The traffic that is timed, or so many of its vehicles, drawn once."""
    drawn = np.random.default_rng(1).permutation(len(VEHICLES))[:vehicles]
    return Traffic.of(Intersection.load("bendplatz"), [Vehicle(str(k), *VEHICLES[k]) for k in sorted(drawn)])


def traffic_with_orders(wanted: int) -> tuple[Traffic, int]:
    """15 vehicles that can cross in about so many orders (within 5 %), and how many it is; always the same ones."""
    for found, orders in _drawn():
        if abs(orders - wanted) <= 0.05 * wanted:
            return found, orders
    raise AssertionError  # the search has no end


@cache
def _kept() -> tuple[list[tuple[Traffic, int]], np.random.Generator]:
    return [], np.random.default_rng(0)


def _drawn() -> Iterator[tuple[Traffic, int]]:
    """Traffics and their numbers of orders, drawn once in a process."""
    kept, generator = _kept()
    yield from kept
    for found in random_traffics(generator):
        cooperative = np.ones(len(found), np.uint8)
        any_order = np.full(len(found.conflicts), -1, np.int8)
        orders = _core.Orders(found.intersection.core, found.core, cooperative, any_order).count_remaining(COUNTED)
        kept.append((found, orders))
        yield kept[-1]


def random_traffics(generator: np.random.Generator | None = None) -> Iterator[Traffic]:
    """Traffics of 15 vehicles without end; always the same ones, unless a generator draws them."""
    generator = generator or np.random.default_rng(0)
    while True:
        yield _random_traffic(generator)


def crowd(vehicles: int = 30) -> Traffic:
    """So many vehicles, with more crossing orders than a planner's cycle has time for; always the same ones."""
    return _random_traffic(np.random.default_rng(0), vehicles)


def _random_traffic(generator: np.random.Generator, count: int = len(VEHICLES)) -> Traffic:
    """So many vehicles on Bendplatz, most within 60 m before their stop lines, none near another on its route."""
    bendplatz = Intersection.load("bendplatz")
    vehicles: list[Vehicle] = []
    while len(vehicles) < count:
        route = bendplatz.routes[int(generator.integers(len(bendplatz.routes)))]
        position = route.stop_line + float(generator.uniform(-60.0, 10.0))
        tried = Vehicle(str(len(vehicles)), route.id, position, float(generator.uniform(0.0, 12.0)))
        if any(one.route == tried.route and abs(one.position - position) < 8.0 for one in vehicles):
            continue
        if not Traffic.of(bendplatz, [*vehicles, tried]).overlaps:
            vehicles.append(tried)
    return Traffic.of(bendplatz, vehicles)


def random_network(generator: np.random.Generator, inputs: int) -> NetworkWeights:
    """A network of random weights: as slow as a trained one."""
    shapes = ((16, inputs), (16, 16), (1, 16))
    layers = [
        (generator.normal(0, 0.3, shape).astype(np.float32), generator.normal(0, 0.1, shape[0]).astype(np.float32))
        for shape in shapes
    ]
    return NetworkWeights(np.zeros(inputs, np.float32), np.full(inputs, 0.05, np.float32), layers)


def both_networks() -> PolicyFile:
    """A policy with both networks inside."""
    generator = np.random.default_rng(0)
    return PolicyFile("network", "network", random_network(generator, 4), random_network(generator, 12))


def rules() -> PolicyFile:
    """Critical gaps and the IDM."""
    return PolicyFile("critical_gap", "idm")


def arithmetic(policy: PolicyFile, vehicles: int, pairs: int) -> tuple[int, int]:
    """Multiply-adds and tanh of the networks in one scenario, had every vehicle and pair to be asked at every step.

    The gap network's activation costs no tanh; the driving network has one more after its last layer.
    """
    assert policy.gap_network is not None
    assert policy.driving_network is not None
    gap, driving = (
        sum(weight.size for weight, _ in network.layers) for network in (policy.gap_network, policy.driving_network)
    )
    tanhs = sum(len(bias) for _, bias in policy.driving_network.layers)
    return _core.STEPS * (pairs * gap + vehicles * driving), _core.STEPS * vehicles * tanhs
