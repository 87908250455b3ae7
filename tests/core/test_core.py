"""The core equals its twin on random traffic, and obeys the laws of traffic."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, _core
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference.collisions import collide
from tests.support.core_and_twin import core_predictor, replayed, weights
from tests.support.random_traffic import random_traffic
from tests.support.twins import (
    CASES,
    as_traffic,
    random_assignment,
    random_case,
    random_networks,
    rounded,
    twin_map,
)

SEEDS = range(12 * CASES)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_core_equals_twin_with_rules(name: str, seed: int, gap: str) -> None:
    traffic, twin = random_case(name, seed)
    assignment = random_assignment(traffic, np.random.default_rng(seed))
    replayed(traffic, twin, core_predictor(traffic, PolicyFile(gap, "idm")), assignment, gap=gap, driver="idm")


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_core_equals_twin_with_networks(name: str, seed: int) -> None:
    traffic, twin = random_case(name, 1000 + seed)
    generator = np.random.default_rng(seed)
    gap, driving = random_networks(generator)
    assignment = random_assignment(traffic, generator)
    policy = PolicyFile("network", "network", weights(gap), weights(driving))
    how = {"gap": "network", "driver": "network", "gap_network": gap, "driver_network": driving}
    replayed(traffic, twin, core_predictor(traffic, policy), assignment, **how)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_core_equals_twin_where_vehicles_wait_past_their_lines(name: str, seed: int) -> None:
    generator = np.random.default_rng(30_000 + seed)
    twin = rounded(random_traffic(twin_map(name), generator, 6, past_line=0.5))
    traffic = as_traffic(Intersection.load(name), twin)
    gap, driving = random_networks(generator)
    policy = PolicyFile("network", "network", weights(gap), weights(driving))
    how = {"gap": "network", "driver": "network", "gap_network": gap, "driver_network": driving}
    replayed(traffic, twin, core_predictor(traffic, policy), random_assignment(traffic, generator), **how)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("gap", ["critical_gap", "sumo", "network"])
def test_core_decides_as_its_twin(name: str, gap: str) -> None:
    """Free decisions may flip at a threshold, and then the futures part; that must stay rare."""
    same = 0
    for seed in range(20):
        traffic, twin = random_case(name, 2000 + seed)
        network, _ = random_networks(np.random.default_rng(seed))
        policy = PolicyFile(gap, "idm", weights(network) if gap == "network" else None)
        assignment = random_assignment(traffic, np.random.default_rng(seed))
        truth = reference.predict(twin_map(name), twin, assignment[0], gap=gap, gap_network=network)  # type: ignore[arg-type]
        enters = core_predictor(traffic, policy).predict(traffic.core, assignment, True, False)[3]
        same += bool((enters[0].astype(bool) == truth.enters).all())
    assert same >= 19


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_observations_and_gap_decisions_equal_the_twin(name: str, gap: Literal["critical_gap", "sumo"]) -> None:
    for seed in SEEDS:
        traffic, twin = random_case(name, 9000 + seed)
        seen = Predictor.load("idm", gap=gap).observe(traffic)
        map_ = twin_map(name)
        pairs = reference.conflicts(map_, twin).reshape(-1, 2)
        truth = reference.observe(map_, twin)
        np.testing.assert_allclose(seen.gap, truth.gap.reshape(-1, 4), atol=1e-3)
        np.testing.assert_allclose(seen.driving[:, : Driving.ENTERS], truth.driving[:, : Driving.ENTERS], atol=1e-3)
        hold = np.full(len(traffic), -1)
        accepts = [
            reference.accepts_gap(map_, twin, pair, features, hold, reference.Rules(gap))
            for pair, features in zip(pairs, truth.gap, strict=True)
        ]
        np.testing.assert_array_equal(seen.accepts, np.array(accepts, bool))


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_conflicts_lane_order_and_commitment_equal_the_twin(name: str, seed: int) -> None:
    traffic, twin = random_case(name, 3000 + seed)
    map_ = twin_map(name)
    np.testing.assert_array_equal(traffic.conflicts, reference.conflicts(map_, twin).reshape(-1, 2))
    arcs = {arc for chain in reference.lane_chains(map_, twin) for arc in itertools.pairwise(chain)}
    assert set(map(tuple, _core.lane_order(traffic.intersection.core, traffic.core).tolist())) == arcs
    goes = reference.initial_memory(map_, twin).delta
    np.testing.assert_array_equal(_core.committed(traffic.intersection.core, traffic.core), goes)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", range(6))
def test_permuting_vehicles_permutes_the_prediction(name: str, seed: int) -> None:
    traffic, _ = random_case(name, 4000 + seed)
    order = np.random.default_rng(seed).permutation(len(traffic))
    fields = ("route", "position", "speed", "length", "width", "max_speed")
    arrays = (getattr(traffic, field)[order] for field in fields)
    permuted = Traffic(traffic.intersection, tuple(traffic.ids[i] for i in order), *arrays)
    predictor = Predictor.load("idm")
    one, other = predictor.predict(traffic), predictor.predict(permuted)
    np.testing.assert_array_equal(one.position[:, :, order], other.position)
    np.testing.assert_array_equal(one.minimum_distance, other.minimum_distance)


@pytest.mark.parametrize("seed", range(6))
def test_a_scenario_does_not_depend_on_its_neighbours(seed: int) -> None:
    traffic, _ = random_case("bendplatz", 5000 + seed)
    generator = np.random.default_rng(seed)
    rows = np.concatenate([random_assignment(traffic, generator) for _ in range(37)])
    predictor = Predictor.load("idm")
    together = predictor.predict(traffic, rows)
    for k in (0, 15, 16, 36):
        alone = predictor.predict(traffic, rows[k : k + 1])
        np.testing.assert_array_equal(together.position[k], alone.position[0])
        np.testing.assert_array_equal(together.time_loss[k], alone.time_loss[0])


def test_v3_and_v4_give_the_same_bytes() -> None:
    if not {"v3", "v4"} <= set(_core.available_kernels()):
        pytest.skip("this machine has no AVX-512: there is nothing to compare")
    for seed in range(10):
        traffic, _ = random_case("bendplatz", 6000 + seed)
        gap, driving = random_networks(np.random.default_rng(seed))
        predictor = core_predictor(traffic, PolicyFile("network", "network", weights(gap), weights(driving)))
        rows = np.zeros((3, len(traffic.conflicts)), np.int8)
        v3, v4 = (predictor.predict(traffic.core, rows, True, True, None, isa) for isa in ("v3", "v4"))
        for one, other in zip(v3, v4, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", MAP_NAMES)
def test_vehicle_that_can_stop_and_is_told_to_wait_never_crosses_its_line(name: str) -> None:
    checked = 0
    for seed in range(40 * CASES):
        traffic, _ = random_case(name, 7000 + seed)
        prediction = Predictor.load("idm").predict(traffic, random_assignment(traffic, np.random.default_rng(seed)))
        stop_line = np.array([traffic.intersection.routes[r].stop_line for r in traffic.route])
        to_line = stop_line - (prediction.position[0] + 0.5 * traffic.length)
        can_stop = to_line >= prediction.speed[0] ** 2 / (2 * 4.0) + 0.2
        held = ~prediction.enters[0]
        before, after = (held & can_stop & (to_line > 0))[:-1], to_line[1:] < 0
        assert not (before & after & held[1:]).any()
        checked += int(before.sum())
    assert checked > 500


@pytest.mark.parametrize("name", MAP_NAMES)
def test_assigned_orders_are_obeyed_by_both_ends(name: str) -> None:
    """Whoever goes second does not reach the conflict before the first one's centre has left it."""
    checked = 0
    for seed in range(80 * CASES):
        traffic, _ = random_case(name, 8000 + seed)
        assignment = random_assignment(traffic, np.random.default_rng(seed))
        prediction = Predictor.load("idm").predict(traffic, assignment)
        between = {(c.yielder, c.prioritized): c for c in traffic.intersection.conflicts}
        for (i, j), way in zip(traffic.conflicts.tolist(), assignment[0].tolist(), strict=True):
            conflict = between[int(traffic.route[i]), int(traffic.route[j])]
            intervals = {i: conflict.on_yielder, j: conflict.on_prioritized}
            if way == 0:
                continue
            first, second = (i, j) if way > 0 else (j, i)
            line = traffic.intersection.routes[int(traffic.route[second])].stop_line
            path = prediction.position[0]
            cleared = path[:, first] >= intervals[first][1]
            crossed = path[:, second] + 0.5 * traffic.length[second] > line
            entered_early = crossed[1:] & ~crossed[:-1] & ~cleared[:-1]
            assert not entered_early.any(), (name, seed, traffic.ids[first], traffic.ids[second])
            checked += 1
    assert checked > 100


@pytest.mark.parametrize("name", MAP_NAMES)
def test_core_finds_the_collision_that_its_twin_finds(name: str) -> None:
    found = 0
    for seed in range(60):
        traffic, twin = random_case(name, 4000 + seed)
        pairs = list(itertools.combinations(range(len(traffic)), 2))
        expected = next((pair for pair in pairs if collide(twin_map(name), twin, *pair)), None)
        assert _core.collision(traffic.intersection.core, traffic.core) == expected
        found += expected is not None
    assert 5 < found < 55
