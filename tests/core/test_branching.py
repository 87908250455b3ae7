"""Many scenarios at once, whose beginnings are predicted once, come out to the bytes of each of them alone."""

from __future__ import annotations

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


@pytest.mark.parametrize("seed", range(8 * CASES))
@pytest.mark.parametrize(("decides", "drives"), DECIDES_AND_DRIVES)
@pytest.mark.parametrize("name", MAP_NAMES)
def test_losses_and_distances_are_those_of_each_alone(name: str, decides: str, drives: str, seed: int) -> None:
    traffic, policy = case(name, seed, decides, drives)
    predictor = core_predictor(traffic, policy)
    rows = assignments(traffic, np.random.default_rng(seed))
    for isa in _core.available_kernels():
        *_, loss, distance, _, _, _, _ = predictor.predict(traffic.core, rows, True, True, None, isa)
        *_, shared_loss, shared_distance, _, _, _, _ = predictor.predict(traffic.core, rows, False, True, None, isa)
        assert shared_loss.tobytes() == loss.tobytes(), isa
        assert shared_distance.tobytes() == distance.tobytes(), isa
        alone = np.concatenate([predictor.predict(traffic.core, row[None], False, False, None, isa)[5] for row in rows])
        np.testing.assert_allclose(shared_loss, alone, atol=2e-5, err_msg=isa)


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
    *_, loss, distance, _, _, _, _ = predictor.predict(traffic.core, np.array(rows, np.int8), True, True)
    shared_loss, shared_distance = predictor.summarize(traffic.core, np.array(rows, np.int8), True)
    assert shared_loss.tobytes() == loss.tobytes()
    assert shared_distance.tobytes() == distance.tobytes()


@pytest.mark.parametrize("patience", ["none", "kept"])
def test_more_scenarios_than_go_on_together_come_out_the_same(patience: str) -> None:
    """With 5,000 of them, in parts of 2,048 at most, and likewise where threads share them."""
    generator = np.random.default_rng(0)
    every = np.concatenate(list(crossing_orders(busy())))
    rows = every[generator.integers(len(every), size=5_000)]
    rows[generator.random(len(rows)) < 0.1] = 0
    predictor = Predictor.load(patience=patience)  # type: ignore[arg-type]
    wanted = predictor.predict(busy(), rows)
    for threads in (1, 2, 3):
        found = Predictor.load(threads=threads, patience=patience).predict(  # type: ignore[arg-type]
            busy(), rows, trajectories=False
        )
        assert found.time_loss.tobytes() == wanted.time_loss.tobytes()
        assert found.minimum_distance.tobytes() == wanted.minimum_distance.tobytes()


def test_traffic_without_pairs_or_vehicles_is_predicted_too() -> None:
    bendplatz = Intersection.load("bendplatz")
    for vehicles in ([], [Vehicle("v", "NW-SE", 20.0, 8.0)]):
        traffic = Traffic.of(bendplatz, vehicles)
        summary = Predictor.load().predict(traffic, np.zeros((40, 0), np.int8), trajectories=False)
        wanted = Predictor.load().predict(traffic).time_loss
        assert summary.time_loss.tolist() == wanted.repeat(40, axis=0).tolist()
        assert (summary.minimum_distance == np.inf).all()
