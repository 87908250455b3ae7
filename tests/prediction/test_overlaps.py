"""Boxes as perception gives them: they overlap at times, and predictions and rankings are made all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from intersection_env import Intersection, Noise, Predictor, Traffic, Vehicle, forecast, rank_maneuvers
from intersection_env.policies.named import shipped_policies
from tests.reference.predict import predict
from tests.support.random_traffic import random_traffic
from tests.support.twins import as_traffic, rounded, twin_map

BENDPLATZ = Intersection.load("bendplatz")
LINE = BENDPLATZ.routes[BENDPLATZ.route_index("SE-NW")].stop_line
OTHERS = [Vehicle("side", "NE-SW", 78.0, 3.0), Vehicle("left", "NW-NE", 140.0, 6.0)]
CASES = {
    "10 cm into its lead": [Vehicle("lead", "SE-NW", 95.0, 8.0), Vehicle("behind", "SE-NW", 90.6, 8.0)],
    "a bicycle beside a car": [
        Vehicle("lead", "SE-NW", 95.0, 4.0, 1.8, 0.6, 5.0),
        Vehicle("behind", "SE-NW", 94.0, 6.0),
    ],
    "one in the other": [Vehicle("lead", "SE-NW", 95.0, 5.0), Vehicle("behind", "SE-NW", 95.0, 5.0)],
}


@pytest.fixture(params=CASES)
def traffic(request: pytest.FixtureRequest) -> Traffic:
    return Traffic.of(BENDPLATZ, [*CASES[request.param], *OTHERS])


def test_overlaps_are_reported(traffic: Traffic) -> None:
    assert traffic.overlaps == (("lead", "behind"),)
    assert Traffic.of(BENDPLATZ, OTHERS).overlaps == ()


@pytest.mark.parametrize("policy", [*shipped_policies(), "idm"])
def test_predictions_are_made_and_sensible(traffic: Traffic, policy: str) -> None:
    """Who is behind lets the other go, and nobody goes backwards."""
    predictor = Predictor.load(policy)
    found = predictor.predict(traffic)
    assert (np.diff(found.position, axis=1) >= 0.0).all()
    assert np.abs(found.acceleration).max() <= 8.0
    lead, behind = traffic.index("lead"), traffic.index("behind")
    if traffic.position[lead] > traffic.position[behind]:
        gap = found.position[0, :, lead] - found.position[0, :, behind]
        assert gap[-1] > gap[0], "they do not come apart"


@pytest.mark.parametrize("seed", range(20))
def test_distances_are_of_all_others_as_the_twin_has_it(seed: int) -> None:
    generator = np.random.default_rng(seed)
    twin = rounded(random_traffic(twin_map("bendplatz"), generator, 8))
    into = int(generator.integers(1, 8))
    route, position = twin.route.copy(), twin.position.copy()
    route[into], position[into] = route[0], np.float32(max(position[0] - generator.uniform(0.0, 1.0), 0.0))
    twin = rounded(replace(twin, route=route, position=position))
    traffic = as_traffic(BENDPLATZ, twin)
    assert ("v0", f"v{into}") in traffic.overlaps
    found = Predictor.load("constant_velocity").predict(traffic)
    wanted = predict(twin_map("bendplatz"), twin, driver="constant_velocity")
    assert found.minimum_distance[0] == pytest.approx(wanted.minimum_distance, abs=1e-3)


def test_a_planner_s_cycle_does_not_fail_for_one_pair(traffic: Traffic) -> None:
    predictor = Predictor.load()
    table = rank_maneuvers(predictor, traffic)
    assert table["safe"].any(), "no order is safe for a pair that overlaps already"
    assert len(forecast(predictor, traffic).orders) > 0
    assert len(forecast(predictor, traffic, noise=Noise(0.1, 0.1, draws=2)).orders) > 0
    later = predictor.predict(traffic).traffic_at(0.2)
    assert predictor.predict(later).minimum_distance[0] >= 0.0


def test_a_pair_that_overlaps_later_counts() -> None:
    """Constant velocity drives the one through the other."""
    driven = [Vehicle("lead", "SE-NW", 95.0, 0.0), Vehicle("behind", "SE-NW", 80.0, 8.0)]
    traffic = Traffic.of(BENDPLATZ, driven)
    assert traffic.overlaps == ()
    assert Predictor.load("constant_velocity").predict(traffic).minimum_distance[0] == 0.0


@pytest.mark.parametrize("speed", [50.0, 40.0])
def test_speeds_that_can_only_be_kilometres_an_hour_are_doubted_by_name(speed: float) -> None:
    vehicles = [Vehicle("fast", "SE-NW", 60.0, speed), Vehicle("slow", "NE-SW", 60.0, 12.0)]
    said = rf"vehicle fast: a speed of {speed:g} m/s is {3.6 * speed:.0f} km/h, more than twice what the map allows"
    with pytest.warns(UserWarning, match=said) as caught:
        Traffic.of(BENDPLATZ, vehicles)
    assert len(caught) == 1


def test_speeds_that_may_be_are_not_doubted(recwarn: pytest.WarningsRecorder) -> None:
    Traffic.of(BENDPLATZ, [Vehicle("fast", "SE-NW", 60.0, 27.0)])
    assert not recwarn.list
