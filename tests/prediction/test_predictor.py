"""The predictor, as its users meet it."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle, rank_maneuvers
from intersection_env.evaluation.errors import error_figures
from intersection_env.prediction.measures import crossing_order, time_loss
from tests.support.busy_traffic import BENDPLATZ, T, busy
from tests.support.single_lane_junction import single_lane_source
from tests.support.twins import random_case


def test_idm_settles_at_the_speed_limit_on_an_empty_road() -> None:
    prediction = Predictor.load("idm").predict(Traffic.of(T, [Vehicle("a", "W-E", 20.0, 8.0)]))
    assert prediction.speed[0, -1, 0] == pytest.approx(50 / 3.6, abs=0.3)
    assert prediction.minimum_distance[0] == np.inf
    assert prediction.time[-1] == pytest.approx(10.0)


def test_time_loss_of_a_standing_vehicle_is_the_time_it_stands() -> None:
    line = T.routes[T.route_index("S-E")].stop_line
    vehicles = [Vehicle("waits", "S-E", line - 3.75, 0.0), Vehicle("first", "W-E", 60.0, 1.0)]
    traffic = Traffic.of(T, vehicles)
    prediction = Predictor.load("idm").predict(traffic, [("first", "waits")])
    assert prediction.time_loss[0, 0] == pytest.approx(10.0, abs=0.05)
    recorded = time_loss(T, int(traffic.route[1]), prediction.position[0, :, 1], prediction.speed[0, :, 1])
    assert recorded[-1] == pytest.approx(prediction.time_loss[0, 1], abs=1e-3)


def test_assigned_priority_turns_the_rule_around() -> None:
    vehicles = [Vehicle("side", "S-W", 88.0, 4.0), Vehicle("main", "W-E", 105.0, 10.0)]
    traffic = Traffic.of(T, vehicles)
    predictor = Predictor.load("idm")
    assert crossing_order(traffic, predictor.predict(traffic)).tolist() == [[-1]]
    assert crossing_order(traffic, predictor.predict(traffic, [("side", "main")])).tolist() == [[1]]


def test_opposing_left_turners_with_through_traffic_behind_do_not_freeze(tmp_path: Path) -> None:
    """docs/model.md, Hold: each waits for the one queued behind the other."""
    source = tmp_path / "single_lane.json"
    source.write_text(single_lane_source())
    junction = Intersection.load(source)
    line = junction.routes[junction.route_index("W-N")].stop_line
    vehicles = [
        Vehicle("W left", "W-N", line - 2.6, 0.0),
        Vehicle("W through", "W-E", line - 9.5, 0.0),
        Vehicle("E left", "E-S", line - 2.6, 0.0),
        Vehicle("E through", "E-W", line - 9.5, 0.0),
    ]
    for gap in ("critical_gap", "sumo"):
        prediction = Predictor.load("idm", gap=gap).predict(Traffic.of(junction, vehicles))
        assert (prediction.position[0, -1] > line).all(), gap
        assert prediction.minimum_distance[0] > 0.0, gap


def test_far_vehicle_changes_nothing() -> None:
    vehicles = [Vehicle("a", "NE-SW", 80.0, 2.0), Vehicle("b", "SE-NW", 120.0, 12.0)]
    far = Vehicle("far", "NW-SE", 318.0, 12.0)
    predictor = Predictor.load("idm")
    one = predictor.predict(Traffic.of(BENDPLATZ, vehicles))
    other = predictor.predict(Traffic.of(BENDPLATZ, [*vehicles, far]))
    np.testing.assert_array_equal(one.position, other.position[:, :, :2])


def test_summary_equals_the_full_prediction() -> None:
    traffic, _ = random_case("bendplatz", 77)
    predictor = Predictor.load("idm")
    full, summary = predictor.predict(traffic), predictor.predict(traffic, trajectories=False)
    np.testing.assert_array_equal(full.time_loss, summary.time_loss)
    np.testing.assert_array_equal(full.minimum_distance, summary.minimum_distance)


def test_empty_traffic_is_predicted() -> None:
    prediction = Predictor.load("idm").predict(Traffic.of(T, []))
    assert prediction.position.shape == (1, 51, 0)
    assert len(rank_maneuvers(Predictor.load("idm"), Traffic.of(T, []))) == 1


def test_traffic_and_predictor_survive_pickling() -> None:
    traffic = pickle.loads(pickle.dumps(busy()))
    for one in (Predictor.load(), Predictor.load("idm", gap="sumo")):
        other = pickle.loads(pickle.dumps(one))
        np.testing.assert_array_equal(other.predict(traffic).position, one.predict(busy()).position)
    np.testing.assert_array_equal(traffic.conflicts, busy().conflicts)


@pytest.mark.parametrize(
    ("priorities", "error", "message"),
    [
        ([("a", "nobody")], ValueError, 'no vehicle "nobody" in this traffic; there are a, b'),
        ([("a", "b")], ValueError, 'vehicles "a" and "b" do not conflict'),
        ([("a", "c"), ("c", "a")], ValueError, "each told to go before the other"),
        ([("b", "c"), ("c", "a")], ValueError, "vehicle . cannot go before vehicle .: the lane order"),
        ([("c", "a"), ("a", "e"), ("e", "c")], ValueError, "cannot go before"),
        (np.zeros((1, 19), np.int64), TypeError, "priorities must be int8, not int64"),
        (np.zeros(18, np.int8), ValueError, r"must have shape \(scenario, 19\)"),
        (np.zeros((1, 18), np.int8), ValueError, r"must have shape \(scenario, 19\)"),
        (np.full((1, 19), 2, np.int8), ValueError, r"must be \+1"),
        (np.full((1, 19), -128, np.int8), ValueError, r"must be \+1"),
        (("a", "c"), ValueError, r"must be pairs \(first, second\) of vehicle ids, not 'a'"),
        ([("a", "c", "e")], ValueError, r"must be pairs \(first, second\)"),
    ],
)
def test_wrong_priorities_are_refused(priorities: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Predictor.load("idm").predict(busy(), priorities)


def test_error_figures_by_hand() -> None:
    figures = error_figures(np.array([-3.0, 0.0, 4.0]))
    assert figures.rmse == pytest.approx(np.sqrt(25 / 3))
    assert figures.mad == 3.0
    assert figures.quantile_80 == pytest.approx(3.6)
    with pytest.raises(ValueError, match="no samples"):
        error_figures(np.zeros(0))
