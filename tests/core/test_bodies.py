"""Bodies are rigid rectangles: the distance between two, by the core, the twin and shapely."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from shapely import Polygon

from intersection_env import Intersection, Predictor, Traffic, Vehicle, _core
from intersection_env.traffic import FLOAT_FIELDS
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference.bodies import corners, rectangle_distance
from tests.reference.intersection import Floats
from tests.reference.outputs import can_touch
from tests.support.busy_traffic import BENDPLATZ, T
from tests.support.twins import CASES, random_assignment, random_case, twin_map

BODIES_APART = 0.002  # [m], float32 at some 300 m from the origin


def rectangle(x: float, y: float, heading: float, length: float, width: float) -> Floats:
    """(4, 2) corners."""
    along = np.array([math.cos(heading), math.sin(heading)]) * length / 2
    across = np.array([-math.sin(heading), math.cos(heading)]) * width / 2
    centre = np.array([x, y])
    return np.array(
        [centre + along + across, centre - along + across, centre - along - across, centre + along - across]
    )


def test_twin_agrees_with_shapely_on_any_two_rectangles() -> None:
    generator, overlapping = np.random.default_rng(0), 0
    for _ in range(3000 * CASES):
        a, b = (rectangle(*generator.uniform((-6, -6, -4, 0.1, 0.1), (6, 6, 4, 12, 12)).tolist()) for _ in range(2))
        truth = Polygon(a).distance(Polygon(b))
        assert rectangle_distance(a, b) == pytest.approx(truth, abs=1e-9)
        overlapping += truth == 0.0
    assert 500 * CASES < overlapping < 2900 * CASES


def test_a_cross_overlaps_though_no_corner_lies_in_the_other() -> None:
    assert rectangle_distance(rectangle(0, 0, 0, 10, 1), rectangle(0, 0, math.pi / 2, 10, 1)) == 0.0


@pytest.mark.parametrize("name", MAP_NAMES)
def test_closest_bodies_of_the_core_are_those_of_shapely(name: str) -> None:
    """At moments of predictions in which nobody brakes: there bodies come near, and overlap."""
    map_, found = twin_map(name), []
    for seed in range(12 * CASES):
        traffic, _ = random_case(name, 60_000 + seed)
        prediction = Predictor.load("constant_velocity").predict(traffic)
        for time in prediction.time[:40:3]:
            now = prediction.traffic_at(float(time))
            floats = (getattr(now, one).astype(np.float64) for one in FLOAT_FIELDS)
            twin = reference.Traffic(now.route.astype(np.int64), *floats)
            pairs = [pair for pair in itertools.combinations(range(len(now)), 2) if can_touch(map_, twin, *pair)]
            bodies = [Polygon(corners(map_, twin, i)) for i in range(len(now))]
            truth = min((bodies[i].distance(bodies[j]) for i, j in pairs), default=math.inf)
            assert least(now) == pytest.approx(truth, abs=BODIES_APART)
            found.append(truth)
    assert sum(one == 0.0 for one in found) > 5
    assert sum(0.0 < one < 5.0 for one in found) > 20


def least(traffic: Traffic) -> float:
    """The smallest distance [m] at one moment, infinite where none can touch."""
    found = _core.closest(traffic.intersection.core, traffic.core)
    return math.inf if found is None else found[0]


@pytest.mark.parametrize("isa", _core.available_kernels())
@pytest.mark.parametrize("policy", ["idm", "constant_velocity"])
def test_smallest_distance_of_a_prediction_is_the_least_of_its_moments(isa: str, policy: str) -> None:
    """Bodies too far apart to be the nearest are passed over in the kernel; none of them was."""
    predictor, found = Predictor.load(policy), []
    for name, seed in itertools.product(MAP_NAMES, range(8 * CASES)):
        traffic, _ = random_case(name, 61_000 + seed)
        core = predictor.bound_to(traffic.intersection)
        rows = np.concatenate([random_assignment(traffic, np.random.default_rng([seed, k])) for k in range(17)])
        together, alone = (core.predict(traffic.core, some, True, True, None, isa) for some in (rows, rows[16:]))
        assert together[6][16] == alone[6][0]
        found.append(float(alone[6][0]))
        if isa == _core.kernel_name():
            prediction = predictor.predict(traffic, rows[16:])
            truth = min(least(prediction.traffic_at(float(time))) for time in prediction.time)
            assert found[-1] == pytest.approx(truth, abs=BODIES_APART)
    assert any(0.0 < one < 3.0 for one in found)
    assert policy == "idm" or found.count(0.0) > 3


def test_a_long_vehicles_middle_is_not_open() -> None:
    """A car whose front is in the side of a bus overlaps it; two circles would leave its middle open."""
    crossing = _crossing(BENDPLATZ, "SE-NW", "NE-SW")
    vehicles = [Vehicle("bus", "SE-NW", crossing[0], 0.0, 18.0, 2.5), Vehicle("car", "NE-SW", crossing[1] - 3.0, 0.0)]
    assert Traffic.of(BENDPLATZ, vehicles).overlaps == (("bus", "car"),)


def _crossing(intersection: Intersection, one: str, other: str) -> tuple[float, float]:
    """The arc lengths at which two routes are nearest to each other."""
    positions = np.linspace(0.0, 200.0, 801, dtype=np.float32)
    a, b = (intersection.sample(intersection.route_index(route), positions)[:, :2] for route in (one, other))
    apart = np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return float(positions[i]), float(positions[j])


def test_a_vehicle_on_the_next_lane_is_not_near() -> None:
    """Opposing cars pass within 2 m of each other, and in a bend corners swing out; neither can touch the other."""
    traffic = Traffic.of(T, [Vehicle("there", "W-E", 100.0, 10.0), Vehicle("back", "E-W", 100.0, 10.0)])
    assert Predictor.load("idm").predict(traffic).minimum_distance[0] == math.inf
