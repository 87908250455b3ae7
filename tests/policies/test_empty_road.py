"""Nobody who drives stands, or crawls, on an empty road: on any route of any map that ships, wherever it starts."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.evaluation.empty_road import empty_road
from intersection_env.evaluation.gates import LEAST_MEAN_SPEED, LEAST_SPEED
from intersection_env.maps.intersection import shipped_maps
from intersection_env.policies.file import IdmParameters, PolicyFile
from intersection_env.policies.named import DEFAULT, GAP_RULES, POLICIES, RULES
from tests.support.core_and_twin import weights
from tests.support.twins import random_networks

EXEMPT: dict[str, str] = {}
"""Policies that fail, and why they ship all the same."""
NO_DRIVERS = ("constant_velocity",)
SHIPPED = sorted(path.stem for path in POLICIES.glob("*.policy"))
DRIVERS = [
    *((name, None) for name in SHIPPED if name not in EXEMPT),
    *((rule, gap) for rule in RULES if rule not in NO_DRIVERS for gap in GAP_RULES),
]


@pytest.mark.parametrize(("policy", "gap"), DRIVERS)
def test_whoever_drives_is_fast_on_an_empty_road(policy: str, gap: str | None) -> None:
    found = empty_road(Predictor.load(policy, gap=gap))
    assert found.least >= LEAST_SPEED, found.where
    assert found.mean >= LEAST_MEAN_SPEED
    assert found.drives > 20 * sum(len(Intersection.load(name).routes) for name in shipped_maps())


def test_who_is_exempt_fails_and_is_not_the_default() -> None:
    """Whoever is mended is exempt no longer."""
    assert set(EXEMPT) <= set(SHIPPED)
    for name in EXEMPT:
        assert empty_road(Predictor.load(name)).least < LEAST_SPEED, f"{name} is mended: take it out of EXEMPT"
    assert DEFAULT not in EXEMPT
    assert DEFAULT in SHIPPED


def test_calibrated_idm_is_as_fast_as_itself() -> None:
    found = empty_road(Predictor.load("idm_calibrated"))
    assert found.least == 1.0
    assert "idm_calibrated" in found.where


def test_a_driver_that_stands_is_found_and_its_worst_drive_named() -> None:
    """A network that always brakes ends at 0 m/s, and one that never starts too."""
    _, driving = random_networks(np.random.default_rng(0))
    braking = weights(driving)
    for _, bias in braking.layers[-1:]:
        bias[:] = -100.0
    found = empty_road(Predictor(PolicyFile("critical_gap", "network", driving_network=braking), "brakes"))
    assert found.least == found.mean == 0.0
    assert found.where.startswith(f"{shipped_maps()[0]}, ")
    constant = empty_road(Predictor.load("constant_velocity"))
    assert constant.least == 0.0
    assert "at 0.0 m/s" in constant.where


def test_faster_driver_is_not_blamed_for_a_lower_limit_that_it_has_reached() -> None:
    """Where the one that starts briskly is after 10 s 30 km/h are allowed, and 50 where the slow one still is."""
    slow, brisk = (
        Predictor(PolicyFile("critical_gap", "idm", idm=IdmParameters(acceleration=rate)), "idm") for rate in (1.2, 3.0)
    )
    place = Intersection.load("crossroads")
    start = Vehicle("a", "E-S", place.routes[place.route_index("E-S")].stop_line - 60.0, 0.0)
    ends = [float(one.predict(Traffic.of(place, [start])).speed[0, -1, 0]) for one in (slow, brisk)]
    assert ends[1] < 0.8 * ends[0]
    found = empty_road(brisk, slow, [place])
    assert found.least > 0.8, found.where


def test_no_start_to_compare_from_is_refused() -> None:
    with pytest.raises(ValueError, match="idm leaves the map, or stands, after 10 s from every start"):
        empty_road(Predictor.load("gap"), Predictor.load("idm"), maps=[])
