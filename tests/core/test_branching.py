"""Many scenarios at once, whose beginnings are predicted once, come out to the bytes of each of them alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Predictor, Traffic, Vehicle, _core, crossing_orders
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.support.busy_traffic import busy
from tests.support.core_and_twin import core_predictor, weights
from tests.support.random_traffic import random_traffic
from tests.support.twins import CASES, as_traffic, random_assignment, random_networks, rounded, twin_map

LANES = {"baseline": 4, "v3": 8, "v4": 16}
PREDICTED = 8  # arrays: positions, speeds, accelerations, who enters and is present, time losses, distances, holds
DECIDES_AND_DRIVES = [("network", "network"), ("critical_gap", "idm"), ("sumo", "network")]


def case(name: str, seed: int, decides: str, drives: str) -> tuple[Traffic, PolicyFile]:
    generator = np.random.default_rng(70_000 + seed)
    drawn = random_traffic(twin_map(name), generator, 9, past_line=0.3 * (seed % 2))
    traffic = as_traffic(Intersection.load(name), rounded(drawn))
    gap, driving = map(weights, random_networks(generator))
    networks = gap if decides == "network" else None, driving if drives == "network" else None
    return traffic, PolicyFile(decides, drives, *networks)


def assignments(traffic: Traffic, generator: np.random.Generator) -> NDArray[np.int8]:
    """Orders, wholly and partly assigned, some of them twice, in any sequence: more than fit into a block."""
    orders = np.concatenate([random_assignment(traffic, generator) for _ in range(30)])
    every = next(crossing_orders(traffic, batch=30), orders[:0])
    some = orders.copy()
    some[:, generator.random(orders.shape[1]) < 0.4] = 0
    rows = np.concatenate([orders, every, some, np.zeros_like(orders[:3]), orders[:10]])
    return np.ascontiguousarray(rows[generator.permutation(len(rows))])


def in_blocks(predictor: _core.Predictor, traffic: Traffic, rows: NDArray[np.int8], isa: str) -> list[NDArray[Any]]:
    """What `predict` returns, of no more scenarios at a time than there are lanes, so that none begins with another."""
    parts = [
        predictor.predict(traffic.core, rows[first : first + LANES[isa]], True, True, None, isa)[:PREDICTED]
        for first in range(0, len(rows), LANES[isa])
    ]
    return [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]


@pytest.mark.parametrize("seed", range(8 * CASES))
@pytest.mark.parametrize(("decides", "drives"), DECIDES_AND_DRIVES)
@pytest.mark.parametrize("name", MAP_NAMES)
def test_scenarios_together_are_each_as_if_alone(name: str, decides: str, drives: str, seed: int) -> None:
    traffic, policy = case(name, seed, decides, drives)
    predictor = core_predictor(traffic, policy)
    rows = assignments(traffic, np.random.default_rng(seed))
    for isa in _core.available_kernels():
        wanted = in_blocks(predictor, traffic, rows, isa)
        together: tuple[Any, ...] = predictor.predict(traffic.core, rows, True, True, None, isa)[:PREDICTED]
        for number, (one, other) in enumerate(zip(together, wanted, strict=True)):
            assert one.tobytes() == other.tobytes(), f"{isa}, array {number}"
        loss, distance = predictor.summarize(traffic.core, rows, True, isa)
        apart_loss, apart_distance = predictor.summarize(traffic.core, rows, True, isa, apart=True)
        assert loss.tobytes() == apart_loss.tobytes() == wanted[5].tobytes()
        assert distance.tobytes() == apart_distance.tobytes() == wanted[6].tobytes()


@pytest.mark.parametrize("name", ["bendplatz", "all_way_stop"])
def test_how_long_each_has_waited_is_as_if_alone_too(name: str) -> None:
    traffic, policy = case(name, 0, "critical_gap", "idm")
    predictor, rows = core_predictor(traffic, policy), assignments(traffic, np.random.default_rng(0))

    def waited(some: NDArray[np.int8]) -> NDArray[np.int32]:
        found = predictor.predict(traffic.core, some, True, True)[9]
        assert found is not None
        return found

    together = waited(rows)
    assert together.any()
    assert together.tobytes() == b"".join(waited(row[None]).tobytes() for row in rows)


@pytest.mark.parametrize("seed", [344, *range(5 * CASES)])
def test_who_is_told_to_wait_counts_for_those_behind(seed: int) -> None:
    """Nobody yields to who stands behind somebody that is told to wait, and most do behind one that a gap makes wait.

    In the first case this is all in which some scenarios differ at a step.
    """
    generator = np.random.default_rng(seed)
    drawn = random_traffic(twin_map("bendplatz"), generator, int(generator.integers(10, 40)))
    traffic = as_traffic(Intersection.load("bendplatz"), rounded(drawn))
    random_networks(generator)
    orders = [random_assignment(traffic, generator)[0] for _ in range(4)]
    orders += list(next(crossing_orders(traffic, batch=4), np.zeros((0, len(traffic.conflicts)), np.int8))[:4])
    rows = []
    for order in orders:
        partly = np.where(generator.random(len(order)) < 0.3, 0, order)
        rows += [np.where(generator.random(len(order)) < 0.15, 0, partly) for _ in range(12)]
    predictor = core_predictor(traffic, PolicyFile("critical_gap", "idm"))
    loss, distance = predictor.summarize(traffic.core, np.array(rows, np.int8), True)
    apart_loss, apart_distance = predictor.summarize(traffic.core, np.array(rows, np.int8), True, apart=True)
    assert loss.tobytes() == apart_loss.tobytes()
    assert distance.tobytes() == apart_distance.tobytes()


@pytest.mark.parametrize("patience", ["none", "kept"])
def test_more_scenarios_than_go_on_together_come_out_the_same(patience: str) -> None:
    """With 5,000 of them, in parts of 2,048 at most, and likewise where threads share them."""
    generator = np.random.default_rng(0)
    every = np.concatenate(list(crossing_orders(busy())))
    rows = every[generator.integers(len(every), size=5_000)]
    rows[generator.random(len(rows)) < 0.1] = 0
    bound = Predictor.load(patience=patience).bound_to(busy().intersection)  # type: ignore[arg-type]
    loss, distance = bound.summarize(busy().core, rows, True, apart=True)
    for threads in (1, 2, 3):
        several = Predictor.load(threads=threads, patience=patience)  # type: ignore[arg-type]
        for trajectories in (False, True):
            found = several.predict(busy(), rows, trajectories=trajectories)
            assert found.time_loss.tobytes() == loss.tobytes()
            assert found.minimum_distance.tobytes() == distance.tobytes()


def test_traffic_without_pairs_or_vehicles_is_predicted_too() -> None:
    bendplatz = Intersection.load("bendplatz")
    for vehicles in ([], [Vehicle("v", "NW-SE", 20.0, 8.0)]):
        traffic = Traffic.of(bendplatz, vehicles)
        summary = Predictor.load().predict(traffic, np.zeros((40, 0), np.int8), trajectories=False)
        wanted = Predictor.load().predict(traffic).time_loss
        assert summary.time_loss.tolist() == wanted.repeat(40, axis=0).tolist()
        assert (summary.minimum_distance == np.inf).all()
