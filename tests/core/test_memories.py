"""The core goes on from memories as its twin does."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from intersection_env import Traffic, _core, crossing_orders
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference.memory import settled
from tests.support.core_and_twin import core_predictor, replayed, weights
from tests.support.memories import memory_of, with_random_memories
from tests.support.twins import CASES, random_case, random_networks, twin_map


def remembering_case(name: str, seed: int) -> tuple[Traffic, reference.Traffic, reference.Memory]:
    traffic, twin = random_case(name, seed)
    traffic = with_random_memories(traffic, np.random.default_rng(seed))
    return traffic, twin, memory_of(traffic)


def first_order(traffic: Traffic) -> np.ndarray[tuple[int, ...], np.dtype[np.int8]]:
    """A feasible order as (1, pair), or none where there is none."""
    found = next(crossing_orders(traffic, batch=1), np.zeros((1, len(traffic.conflicts)), np.int8))
    return _core.complete(traffic.intersection.core, traffic.core, np.ascontiguousarray(found))


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("seed", range(8 * CASES))
def test_core_equals_twin_from_memories(name: str, seed: int) -> None:
    traffic, twin, memory = remembering_case(name, 50_000 + seed)
    gap, driving = random_networks(np.random.default_rng(seed))
    policy = PolicyFile("network", "network", weights(gap), weights(driving))
    how = {"gap": "network", "driver": "network", "gap_network": gap, "driver_network": driving, "memory": memory}
    replayed(traffic, twin, core_predictor(traffic, policy), first_order(traffic), **how)


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_core_decides_and_holds_from_memories_as_its_twin(name: str, gap: str) -> None:
    same, cases = 0, 20 * CASES
    for seed in range(cases):
        traffic, twin, memory = remembering_case(name, 51_000 + seed)
        order = first_order(traffic) if seed % 2 else np.zeros((1, len(traffic.conflicts)), np.int8)
        truth = reference.predict(twin_map(name), twin, order[0], gap=gap, memory=memory)  # type: ignore[arg-type]
        results = core_predictor(traffic, PolicyFile(gap, "idm")).predict(traffic.core, order, True, False)
        decided_alike = (results[3][0].astype(bool) == truth.enters).all()
        same += bool(decided_alike and (results[7][0] == truth.hold).all())
    assert same >= cases - 1, "decisions flip at thresholds, rarely"


@pytest.mark.parametrize("name", MAP_NAMES)
def test_commitment_lane_order_and_orders_from_memories_equal_the_twin(name: str) -> None:
    found = 0
    for seed in range(60 * CASES):
        traffic, twin, memory = remembering_case(name, 52_000 + seed)
        map_, core = twin_map(name), (traffic.intersection.core, traffic.core)
        np.testing.assert_array_equal(_core.committed(*core), settled(map_, twin, memory))
        arcs = {arc for chain in reference.lane_chains(map_, twin, memory) for arc in itertools.pairwise(chain)}
        assert set(map(tuple, _core.lane_order(*core).tolist())) == arcs
        if len(traffic.conflicts) <= 10:
            truth = reference.orders(map_, twin, memory=memory)
            assert {tuple(order) for orders in crossing_orders(traffic) for order in orders.tolist()} == truth
            found += len(truth)
    assert found > 100


def test_twin_goes_on_from_its_memories() -> None:
    """To the bit: so the memories are all that a prediction remembers."""
    for seed in range(4):
        _, twin = random_case("bendplatz", 53_000 + seed)
        map_, step = twin_map("bendplatz"), 7
        whole = reference.predict(map_, twin, steps=20)
        on = whole.present[step]
        fields = {name: getattr(twin, name)[on] for name in ("route", "length", "width", "max_speed")}
        later = reference.Traffic(position=whole.position[step, on], speed=whole.speed[step, on], **fields)
        memory = reference.Memory(on[on], whole.enters[step - 1, on], whole.hold[step - 1, on])
        rest = reference.predict(map_, later, steps=20 - step, memory=memory)
        np.testing.assert_array_equal(rest.position, whole.position[step:, on])
        np.testing.assert_array_equal(rest.hold[:-1], whole.hold[step:-1, on])
