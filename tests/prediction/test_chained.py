"""Predictions chained step by step: what vehicles remember is not lost."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Prediction, Predictor, Traffic, Vehicle, _core, rank_maneuvers
from intersection_env.constants import DT, STEPS
from intersection_env.maps.intersection import MAPS
from intersection_env.policies.file import PolicyFile
from tests.support.busy_traffic import BENDPLATZ, T, busy
from tests.support.core_and_twin import core_predictor, weights
from tests.support.memories import remembering, with_random_memories
from tests.support.single_lane_junction import single_lane_source
from tests.support.twins import CASES, random_assignment, random_case, random_networks

SHIPPED = sorted(path.stem for path in MAPS.glob("*.map"))
POLICIES = ("idm", "idm_calibrated", "rollout_gradient", "gap")


def four_way_tie(folder: Path) -> Traffic:
    """One vehicle stands at each line, and everybody yields to who comes from the right."""
    source = folder / "single_lane.json"
    source.write_text(single_lane_source())
    junction = Intersection.load(source)
    ways = [junction.routes[junction.route_index(name)] for name in ("N-S", "S-N", "E-W", "W-E")]
    return Traffic.of(junction, [Vehicle(way.id, way.id, way.stop_line - 2.6, 0.0) for way in ways])


@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_four_way_tie_clears_when_predictions_are_chained(tmp_path: Path, steps: int, gap: str) -> None:
    tie = four_way_tie(tmp_path)
    predictor = Predictor.load("idm", gap=gap)
    traffic, gone = tie, set[str]()
    for _ in range(STEPS // steps * 2):
        traffic = predictor.predict(traffic).traffic_at(steps * DT)
        fronts = zip(traffic.ids, traffic.route, traffic.position, strict=True)
        gone |= {one for one, route, x in fronts if x > traffic.intersection.routes[route].junction[1]}
    assert gone == set(tie.ids)


def same_to_the_byte(whole: Prediction, scenario: int, step: int, later: Prediction) -> None:
    on = whole.present[scenario, step]
    for name in ("position", "speed", "enters", "present", "hold"):
        ours, theirs = getattr(later, name)[0, : STEPS - step], getattr(whole, name)[scenario, step:STEPS, on].T
        np.testing.assert_array_equal(ours, theirs, err_msg=name)


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("policy", POLICIES)
def test_chained_prediction_equals_one_prediction(name: str, policy: str) -> None:
    predictor, generator = Predictor.load(policy), np.random.default_rng(3)
    for seed in range(8 * CASES):
        traffic, _ = random_case(name, 40_000 + seed)
        whole = predictor.predict(traffic)
        for step in (0, 1, 2, *generator.integers(3, STEPS, 1).tolist(), STEPS):
            later = whole.traffic_at(float(whole.time[step]))
            assert later.ids == tuple(np.array(traffic.ids)[whole.present[0, step]])
            same_to_the_byte(whole, 0, step, predictor.predict(later))


@pytest.mark.parametrize("name", SHIPPED)
def test_chained_prediction_keeps_to_its_order(name: str) -> None:
    predictor, generator, assigned, implied = Predictor.load("idm"), np.random.default_rng(4), 0, 0
    for seed in range(12 * CASES):
        traffic, _ = random_case(name, 41_000 + seed)
        rows = np.concatenate([random_assignment(traffic, generator) for _ in range(20)])
        whole = predictor.predict(traffic, rows)
        assert whole.priorities is not None
        np.testing.assert_array_equal(whole.priorities, rows)
        for step in (1, 2, *generator.integers(3, STEPS, 1).tolist()):
            for scenario in range(len(rows)):
                later = whole.traffic_at(step * DT, scenario)
                priorities = whole.priorities_at(step * DT, scenario)
                again = predictor.predict(later, priorities)
                assert again.priorities is not None
                if (again.priorities[0] == priorities).all():
                    same_to_the_byte(whole, scenario, step, again)
                    assigned += int(np.count_nonzero(priorities))
                else:  # who could not stop at first now can, and waits behind one that was told to wait
                    implied += 1
    assert assigned > 500
    assert implied < 50


def test_an_order_is_kept_when_the_first_is_leaving_and_the_second_has_started() -> None:
    """The pair stays open until the long yielder's rear has left; the other may go once its centre has."""
    main, side = (T.routes[T.route_index(name)].stop_line for name in ("W-E", "S-W"))
    vehicles = [Vehicle("long", "S-W", side - 15.0, 3.0, length=28.0), Vehicle("main", "W-E", main - 4.0, 0.0)]
    predictor, under_way = Predictor.load("idm"), 0
    whole = predictor.predict(Traffic.of(T, vehicles), [("long", "main")])
    for step in range(1, STEPS):
        later, priorities = whole.traffic_at(step * DT), whole.priorities_at(step * DT)
        same_to_the_byte(whole, 0, step, predictor.predict(later, priorities))
        goes = dict(zip(later.ids, _core.committed(T.core, later.core).tolist(), strict=True))
        under_way += priorities.tolist() == [1] and goes["main"]
    assert under_way > 2


@pytest.mark.parametrize("isa", _core.available_kernels())
def test_a_block_and_single_scenarios_go_on_alike(isa: str) -> None:
    for seed in range(10):
        traffic, _ = random_case("bendplatz", 42_000 + seed)
        gap, driving = random_networks(np.random.default_rng(seed))
        core = core_predictor(traffic, PolicyFile("network", "network", weights(gap), weights(driving)))
        later = with_random_memories(traffic, np.random.default_rng(seed))
        rows = np.zeros((17, len(traffic.conflicts)), np.int8)
        block, one = (core.predict(later.core, some, True, True, None, isa) for some in (rows, rows[:1]))
        for many, single in zip(block[:-1], one[:-1], strict=True):  # not patience: of vehicles alone
            np.testing.assert_array_equal(np.asarray(many)[[0, 16]], np.repeat(np.asarray(single), 2, axis=0))


def test_a_vehicle_that_remembers_to_wait_can_be_put_second_where_the_rule_has_it_go() -> None:
    line = T.routes[T.route_index("E-S")].stop_line
    crept = Traffic.of(T, [Vehicle("left", "E-S", line - 1.0, 1.5), Vehicle("main", "W-E", 90.0, 8.0)])
    assert _core.committed(T.core, crept.core).tolist() == [True, False]
    with pytest.raises(ValueError, match="vehicle left cannot wait for vehicle main: it can no longer stop"):
        Predictor.load("idm").predict(crept, [("main", "left")])
    waits = remembering(crept, np.array([False, True]), np.array([-1, -1], np.int16))
    assert _core.committed(T.core, waits.core).tolist() == [False, False]
    assert Predictor.load("idm").predict(waits, [("main", "left")]).enters[0, 0].tolist() == [False, True]
    assert set(rank_maneuvers(Predictor.load("idm"), waits)["order"]) == {
        "no intervention",
        "left, main",
        "main, left",
    }


def test_rule_is_the_memory_of_a_start() -> None:
    traffic = busy()
    core = traffic.intersection.core, traffic.core
    explicit = remembering(traffic, _core.committed(*core), np.full(len(traffic), -1, np.int16))
    one, other = (Predictor.load().predict(which) for which in (traffic, explicit))
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.hold, other.hold)


def test_memories_survive_pickling_and_copying_and_are_read_only() -> None:
    traffic = Predictor.load().predict(busy()).traffic_at(2.0)
    assert traffic.delta is not None
    assert traffic.hold is not None
    for other in (pickle.loads(pickle.dumps(traffic)), copy.copy(traffic), copy.deepcopy(traffic)):
        np.testing.assert_array_equal(other.delta, traffic.delta)
        np.testing.assert_array_equal(other.hold, traffic.hold)
        assert other.overlaps == traffic.overlaps
        np.testing.assert_array_equal(
            Predictor.load().predict(other).position, Predictor.load().predict(traffic).position
        )
    with pytest.raises(ValueError, match="read-only"):
        traffic.hold[0] = 3


def of(values: list[Any], dtype: type) -> NDArray[Any]:
    return np.array(values, dtype)


@pytest.mark.parametrize(
    ("delta", "hold", "error", "message"),
    [
        (None, of([-1, -1], np.int16), ValueError, "memories need both delta and hold, or neither"),
        (of([True, True], np.bool_), None, ValueError, "memories need both delta and hold, or neither"),
        (of([1, 0], np.uint8), of([-1, -1], np.int16), TypeError, "delta must be an array of bool, not uint8"),
        (of([True, True], np.bool_), of([-1, -1], np.int64), TypeError, "hold must be an array of int16, not int64"),
        (of([True], np.bool_), of([-1, -1], np.int16), ValueError, r"delta must have shape \(2,\)"),
        (
            of([True, True], np.bool_),
            of([-1, 7], np.int16),
            ValueError,
            "vehicle y: hold must be from -1 to 6, .* not 7",
        ),
        (
            of([True, True], np.bool_),
            of([-2, 0], np.int16),
            ValueError,
            "vehicle x: hold must be from -1 to 6, .* not -2",
        ),
    ],
)
def test_malformed_memories_are_refused(delta: Any, hold: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        remembering(Traffic.of(T, [Vehicle("x", "W-E", 50, 5), Vehicle("y", "W-E", 100, 5)]), delta, hold)


@pytest.mark.parametrize("time", [0.1, -0.2, 10.2, float("nan")])
def test_a_time_that_was_not_predicted_is_refused(time: float) -> None:
    with pytest.raises(ValueError, match=r"time must be a multiple of 0.2 s from 0 to 10.0, not"):
        Predictor.load().predict(busy()).traffic_at(time)


def test_trajectories_from_elsewhere_have_no_memories() -> None:
    elsewhere = replace(Predictor.load().predict(busy()), hold=None, priorities=None)
    with pytest.raises(ValueError, match="these trajectories are not those of one traffic by a Predictor"):
        elsewhere.traffic_at(0.2)
    with pytest.raises(ValueError, match="these trajectories are not those of one traffic by a Predictor"):
        elsewhere.priorities_at(0.2)


@pytest.mark.parametrize("scenario", [-1, 1])
def test_a_scenario_that_was_not_predicted_is_refused(scenario: int) -> None:
    with pytest.raises(ValueError, match=f"scenario must be from 0 to 0, not {scenario}"):
        Predictor.load().predict(busy()).priorities_at(0.2, scenario)


def test_an_order_is_not_handed_on_where_vehicles_of_one_lane_have_passed_through_each_other() -> None:
    """The one behind is too near and too fast to stop behind the other."""
    line, main = (BENDPLATZ.routes[BENDPLATZ.route_index(name)].stop_line for name in ("SW-NE", "SE-NW"))
    vehicles = [
        Vehicle("ahead", "SW-NE", line - 20.0, 2.0),
        Vehicle("behind", "SW-NE", line - 25.2, 13.0),
        Vehicle("main", "SE-NW", main - 30.0, 8.0),
    ]
    whole = Predictor.load().predict(Traffic.of(BENDPLATZ, vehicles), [("ahead", "main"), ("main", "behind")])
    passed = int((whole.position[0, :, 1] > whole.position[0, :, 0]).argmax())
    assert 0 < passed < 10
    before = whole.traffic_at((passed - 1) * DT)
    same_to_the_byte(whole, 0, passed - 1, Predictor.load().predict(before, whole.priorities_at((passed - 1) * DT)))
    with pytest.raises(
        ValueError, match="vehicles of one lane have passed through each other, and vehicle main cannot go"
    ):
        whole.priorities_at(passed * DT)
    assert len(whole.traffic_at(passed * DT)) == 3
