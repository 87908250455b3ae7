"""A driver's patience: the core keeps what its twin keeps, and the twin by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference.memory import initial_memory
from tests.reference.patience import waits
from tests.support.core_and_twin import weights
from tests.support.memories import memory_of, with_random_memories
from tests.support.placing import T_JUNCTION, place
from tests.support.random_traffic import random_traffic
from tests.support.twins import CASES, as_traffic, random_networks, rounded, twin_map

ALWAYS = reference.Network(np.zeros(4), np.ones(4), ((np.zeros((1, 4)), np.array([2.0])),))


def standing_case(name: str, seed: int) -> tuple[Traffic, reference.Traffic]:
    """Random traffic in which half of the drivers stand, most of them near their lines."""
    generator = np.random.default_rng(seed)
    twin = random_traffic(twin_map(name), generator, 9, past_line=0.7)
    speed = np.where(generator.random(9) < 0.5, generator.choice((0.0, 0.05, 0.2), 9), twin.speed)
    twin = rounded(replace(twin, speed=speed))
    return as_traffic(Intersection.load(name), twin), twin


@pytest.mark.parametrize("name", MAP_NAMES)
def test_core_draws_the_patience_of_its_twin(name: str) -> None:
    waiting = 0
    for seed in range(30 * CASES):
        traffic, twin = standing_case(name, 70_000 + seed)
        generator = np.random.default_rng(seed)
        network, _ = random_networks(generator)
        levels, memory = generator.uniform(0.02, 0.98, len(traffic)), None
        if seed % 2:
            traffic = with_random_memories(traffic, generator)
            memory = memory_of(traffic)
        predictor = Predictor(PolicyFile("network", "idm", weights(network)), "random")
        truth = reference.patience(twin_map(name), twin, network, levels, memory)
        np.testing.assert_allclose(predictor.patience_of(traffic, levels), truth, rtol=1e-4, atol=1e-4)
        waiting += int((np.abs(truth - np.log(levels / (1.0 - levels))) > 0.01).sum())
    assert waiting > 5


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("drawn", [False, True])
def test_core_decides_by_patience_as_its_twin(name: str, drawn: bool) -> None:
    """Free decisions may flip at a threshold, and then the futures part; that must stay rare."""
    same, moved, cases = 0, 0, 20 * CASES
    for seed in range(cases):
        traffic, twin = standing_case(name, 71_000 + seed)
        generator = np.random.default_rng(seed)
        network, _ = random_networks(generator)
        levels = generator.uniform(0.02, 0.98, len(traffic)) if drawn else np.full(len(traffic), 0.5)
        kept = reference.patience(twin_map(name), twin, network, levels)
        truth = reference.predict(twin_map(name), twin, gap="network", gap_network=network, patience=kept)
        predictor = Predictor(PolicyFile("network", "idm", weights(network)), "random", patience="kept")
        given = replace(traffic, patience=predictor.patience_of(traffic, levels)) if drawn else traffic
        found = predictor.predict(given)
        same += bool((found.enters[0] == truth.enters).all())
        anew = Predictor(predictor.policy, "random", patience="none").predict(traffic)
        moved += bool((found.enters != anew.enters).any())
    assert same >= cases - 2
    if name == "all_way_stop":  # who arrived first goes first: nobody judges a gap
        assert moved == 0
    else:
        assert moved >= 2, "patience changes something"


def test_who_waits_is_the_median_of_those_who_refuse() -> None:
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("W-E", 40, 12))
    chance = 1.0 / (1.0 + np.exp(-2.0))
    quantile = (1.0 + chance) / 2.0
    kept = reference.patience(T_JUNCTION, traffic, ALWAYS, np.array([0.5, 0.5]))
    np.testing.assert_allclose(kept, [np.log(quantile / (1.0 - quantile)), 0.0])
    accepts = [
        reference.predict(T_JUNCTION, traffic, gap="network", gap_network=ALWAYS, patience=one, steps=1).enters[0, 0]
        for one in (None, kept)
    ]
    assert accepts == [True, False]


@pytest.mark.parametrize(
    ("before", "speed", "waiting"),
    [(1.5, 0.0, True), (1.5, 0.09, True), (1.5, 0.11, False), (4.9, 0.0, True), (5.1, 0.0, False), (-1.0, 0.0, True)],
)
def test_who_stands_within_five_metres_of_its_line_waits(before: float, speed: float, waiting: bool) -> None:
    traffic = place(T_JUNCTION, ("S-W", before, speed), ("W-E", 40, 12))
    assert waits(T_JUNCTION, traffic, initial_memory(T_JUNCTION, traffic), 0) == waiting


def test_who_is_under_way_or_sees_nobody_has_refused_nothing() -> None:
    alone = place(T_JUNCTION, ("S-W", 1.5, 0))
    np.testing.assert_allclose(reference.patience(T_JUNCTION, alone, ALWAYS, np.array([0.8])), np.log(4.0))
    traffic = place(T_JUNCTION, ("S-W", 1.5, 0), ("W-E", 40, 12))
    goes = reference.Memory(np.ones(2, np.bool_), np.array([True, True]), np.array([-1, -1]))
    np.testing.assert_allclose(reference.patience(T_JUNCTION, traffic, ALWAYS, np.full(2, 0.5), goes), 0.0)
