"""Who circulates goes first: an entering vehicle never cuts it, in predictions and in the closed loop."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.prediction.predictor import Prediction
from tests.support.random_traffic import random_traffic
from tests.support.twins import CASES, as_traffic, rounded, twin_map

CRITICAL = 4.0  # [s], of a merging conflict
RULES = (("idm", "critical_gap"), ("idm_calibrated", None), ("ppo", None), ("gap", None))


def conflict_of(intersection: Intersection, yielder: str, prioritized: str) -> tuple[float, float, float]:
    """Where the prioritized one is in the conflict, from and to, and the yielder's PGA [m]."""
    pair = intersection.route_index(yielder), intersection.route_index(prioritized)
    found = next(one for one in intersection.conflicts if (one.yielder, one.prioritized) == pair)
    return *found.on_prioritized, found.on_yielder[1]


def test_conflicts_of_a_roundabout_are_at_the_entries() -> None:
    roundabout = Intersection.load("roundabout")
    for conflict in roundabout.conflicts:
        yielder, prioritized = roundabout.routes[conflict.yielder], roundabout.routes[conflict.prioritized]
        assert conflict.merging
        assert yielder.stop_line < conflict.on_yielder[0] < conflict.on_yielder[1] < yielder.stop_line + 15.0
        assert conflict.on_prioritized[0] > prioritized.stop_line + 15.0, "it circulates already"
        before = conflict.on_yielder[0] - yielder.stop_line
        assert conflict.line == pytest.approx(conflict.on_prioritized[0] - before, abs=1e-3)


def test_routes_yield_to_each_other_at_two_entries() -> None:
    roundabout = Intersection.load("roundabout")
    pairs = {(roundabout.routes[c.yielder].id, roundabout.routes[c.prioritized].id) for c in roundabout.conflicts}
    assert {("E-S", "W-N"), ("W-N", "E-S"), ("E-E", "W-W"), ("W-W", "E-E")} <= pairs
    shared = [(one.a, one.b) for one in roundabout.shared_lanes]
    assert max(shared.count(pair) for pair in shared) == 2


@pytest.mark.parametrize("route", ["E-N", "E-S", "E-E"])
@pytest.mark.parametrize(("driver", "gap"), RULES[:2])
def test_circulating_car_that_is_near_drives_as_if_alone(driver: str, gap: str | None, route: str) -> None:
    roundabout, predictor = Intersection.load("roundabout"), Predictor.load(driver, gap=gap)
    begin, end, _ = conflict_of(roundabout, route, "W-N")
    line = roundabout.routes[roundabout.route_index(route)].stop_line
    for way in np.linspace(5.0, 18.0, 6):
        circulating = Vehicle("circulating", "W-N", float(begin - way - 2.25), 6.0)
        for before in (4.0, 12.0, 25.0):
            entering = Vehicle("entering", route, float(line - before - 2.25), 5.0)
            both = predictor.predict(Traffic.of(roundabout, [circulating, entering]))
            alone = predictor.predict(Traffic.of(roundabout, [circulating]))
            until = int(np.argmax(alone.position[0, :, 0] > end + 2.0))
            assert until > 0
            np.testing.assert_array_equal(both.position[0, :until, 0], alone.position[0, :until, 0])


@pytest.mark.parametrize("route", ["E-N", "E-S", "E-E"])
def test_entering_car_does_not_wait_for_one_that_has_yet_far_to_go(route: str) -> None:
    """It is measured how far that one is from the entry, not from its own line that it has left behind."""
    roundabout, predictor = Intersection.load("roundabout"), Predictor.load("idm")
    line = roundabout.routes[roundabout.route_index(route)].stop_line
    circulating = Vehicle("circulating", "W-W", 126.0, 2.0)
    entering = Vehicle("entering", route, float(line - 8.0), 3.0)
    found = predictor.observe(Traffic.of(roundabout, [circulating, entering]))
    assert len(found.gap) == 1
    begin, _, _ = conflict_of(roundabout, route, "W-W")
    assert 5.0 < begin - 128.25 - found.gap[0, 2] < 10.0, "to a place before the entry"
    assert found.accepts[0]


@pytest.mark.parametrize(("driver", "gap"), RULES)
def test_nobody_who_circulates_is_cut(driver: str, gap: str | None) -> None:
    """When an entering vehicle can last stop, who circulates is far enough, and no bodies touch at the entry."""
    roundabout, predictor = Intersection.load("roundabout"), Predictor.load(driver, gap=gap)
    found: list[float] = []
    for seed in range(150 * CASES):
        generator = np.random.default_rng(seed)
        traffic = as_traffic(roundabout, rounded(random_traffic(twin_map("roundabout"), generator, 8)))
        found += gaps_taken(traffic, predictor.predict(traffic))
    assert len(found) > 40
    if gap == "critical_gap":
        assert min(found) > CRITICAL
    else:
        assert np.quantile(found, 0.01) > 1.0, "learned gaps are shorter, not nothing"
        assert min(found) > 0.5, "of 1,324 gaps taken in ten times as many traffics, three were below 1 s"


def gaps_taken(traffic: Traffic, prediction: Prediction) -> list[float]:
    """How far circulating vehicles are from an entry, beside its line [s], when the one that enters can last stop."""
    intersection, found = traffic.intersection, []
    stop_line = np.array([intersection.routes[route].stop_line for route in traffic.route])
    junction = np.array([intersection.routes[route].junction[0] for route in traffic.route])
    position, speed = prediction.position[0].astype(np.float64), prediction.speed[0].astype(np.float64)
    to_line = stop_line - position - traffic.length / 2
    able = to_line >= speed**2 / 8.0
    for i, j in traffic.conflicts.tolist():
        pair = int(traffic.route[i]), int(traffic.route[j])
        conflict = next(one for one in intersection.conflicts if (one.yielder, one.prioritized) == pair)
        if not able[0, i] or able[:, i].all():
            continue
        step = int(np.argmin(able[:, i])) - 1
        is_open = prediction.present[0, step, j] and position[step, j] < conflict.on_prioritized[1]
        if is_open and position[step, j] > junction[j] + 10.0:
            way = conflict.line - position[step, j] - traffic.length[j] / 2
            found.append(float(way / max(speed[step, j], 1.0)))
    return found
