"""Makes the same random cases for the core and for its twin."""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env import Intersection, Traffic, _core
from intersection_env.maps.intersection import MAPS
from tests.reference import predictor as reference
from tests.support.random_traffic import random_traffic

CASES = int(os.environ.get("RANDOM_CASES", "1"))
"""Multiplies the number of random cases; `make harden` raises it."""


@cache
def twin_map(name: str) -> reference.Map:
    """The shipped map as the twin reads it."""
    return reference.load_map(MAPS / f"{name}.map")


@cache
def twin_of(intersection: Intersection) -> reference.Map:
    """Any map as the twin reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "compiled.map"
        path.write_text(intersection.text, encoding="utf-8")
        return reference.load_map(path)


def as_traffic(intersection: Intersection, twin: reference.Traffic) -> Traffic:
    """The twin's vehicles as the core takes them."""
    floats = (getattr(twin, name).astype(np.float32) for name in ("position", "speed", "length", "width", "max_speed"))
    ids = tuple(f"v{i}" for i in range(len(twin.route)))
    return Traffic(intersection, ids, twin.route.astype(np.int32), *floats)


def rounded(twin: reference.Traffic) -> reference.Traffic:
    """The same vehicles with every number exactly representable in float32."""
    floats = {
        name: getattr(twin, name).astype(np.float32).astype(np.float64)
        for name in ("position", "speed", "length", "width", "max_speed")
    }
    return reference.Traffic(route=twin.route, **floats)


def random_case(name: str, seed: int) -> tuple[Traffic, reference.Traffic]:
    """Random traffic on a shipped map: for the core, and for the twin."""
    generator = np.random.default_rng(seed)
    twin = rounded(random_traffic(twin_map(name), generator, int(generator.integers(0, 13))))
    return as_traffic(Intersection.load(name), twin), twin


def random_assignment(traffic: Traffic, generator: np.random.Generator) -> NDArray[np.int8]:
    """A feasible assignment (1, pair): part of a random crossing order, completed by the core."""
    preferred = generator.choice(np.array([-1, 1], np.int8), len(traffic.conflicts))
    cooperative = generator.integers(0, 2, len(traffic)).astype(np.uint8)
    orders = _core.Orders(traffic.intersection.core, traffic.core, cooperative, preferred)
    found = orders.next(1)
    return found if len(found) else np.zeros((1, len(traffic.conflicts)), np.int8)


def random_networks(generator: np.random.Generator) -> tuple[reference.Network, reference.Network]:
    """A gap network and a driving network with weights of a trained network's size."""
    gap = _network(generator, 4, np.array([5.0, 5.0, 30.0, 8.0]), np.array([0.1, 0.1, 0.03, 0.1]))
    shift = np.array([10.0, 7.0, 11.0, 0, 0, 0, 0, 0, 0, 40.0, 12.0, 0.5])
    scale = np.array([0.05, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 0.03, 0.08, 1.0])
    return gap, _network(generator, 12, shift, scale)


def random_order_network(generator: np.random.Generator) -> reference.Network:
    """An order network, likewise."""
    of_vehicle = (30.0, 40.0, 25.0, 6.0, 12.0, 55.0, 15.0, 4.5), (0.03, 0.03, 0.03, 0.2, 0.2, 0.025, 0.08, 0.5)
    of_pair = (0.5, 6.0, 1.0, 6.0, 1.0), (2.0, 0.2, 0.5, 0.2, 0.5)
    shift, scale = (np.array([*of_vehicle[k], *of_vehicle[k], *of_pair[k]]) for k in (0, 1))
    return _network(generator, len(shift), shift, scale, units=32)


def _network(
    generator: np.random.Generator, inputs: int, shift: NDArray[np.float64], scale: NDArray[np.float64], units: int = 16
) -> reference.Network:
    sizes = ((units, inputs), (units, units), (1, units))
    layers = tuple(
        (generator.normal(0, 1.2 / np.sqrt(shape[1]), shape), generator.normal(0, 0.1, shape[0])) for shape in sizes
    )
    return reference.Network(shift=shift, scale=scale, layers=layers)
