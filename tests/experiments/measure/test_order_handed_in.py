"""With the recorded order handed in, predictions cross in it; where it must be refused, nothing is handed in."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.measure.horizon import measured
from experiments.measure.order_handed_in import OrderHandedIn
from experiments.report.tables import order_handed_in_table
from experiments.show.horizon import order_handed_in_text
from intersection_env import Intersection, Predictor
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import Moment
from intersection_env.evaluation.recorded_order import recorded_order
from intersection_env.prediction.measures import crossing_order
from tests.experiments.measure.test_crossing_order import first, pair

FEASIBLE = ((20, 24), (24, 20), (30, 26), (40, 43), (43, 40))
TOO_LATE = ((2, 1),)
"""Steps at which yielder and prioritized vehicle arrive; the yielder can no longer stop."""


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


def moments_of_pairs(*arrivals: tuple[int, int]) -> list[Moment]:
    bendplatz = Intersection.load("bendplatz")
    return first(bendplatz, *(pair(bendplatz, *steps, f"{10 + k}") for k, steps in enumerate(arrivals)))


def test_prediction_follows_the_recorded_order_that_it_is_told() -> None:
    moments, idm = moments_of_pairs(*FEASIBLE), Predictor.load("idm")
    (informed,) = OrderHandedIn.to([idm], moments)
    assert informed.name == "idm"
    recorded = [recorded_order(moment)[0].tolist() for moment in moments]
    assert {tuple(order) for order in recorded} == {(1,), (-1,)}
    told = [crossing_order(one.traffic, informed.predict(one.traffic))[0].tolist() for one in moments]
    by_itself = [crossing_order(one.traffic, idm.predict(one.traffic))[0].tolist() for one in moments]
    assert told == recorded != by_itself
    assert informed.refused == 0


def test_order_that_a_vehicle_can_no_longer_follow_is_not_handed_in_and_counted() -> None:
    moments, idm = moments_of_pairs(*FEASIBLE[:1], *TOO_LATE), Predictor.load("idm")
    (late,) = moments[1:]
    with pytest.raises(ValueError, match="can no longer"):
        idm.predict(late.traffic, recorded_order(late)[0])
    (informed,) = OrderHandedIn.to([idm], moments)
    for moment in moments:
        informed.predict(moment.traffic)
    np.testing.assert_array_equal(informed.predict(late.traffic).position, idm.predict(late.traffic).position)
    assert informed.refused == 2


def test_unknown_traffic_is_no_reason_to_predict_without() -> None:
    moments = moments_of_pairs(*FEASIBLE[:1])
    (informed,) = OrderHandedIn.to([Predictor.load("idm")], moments)
    (other,) = moments_of_pairs(*FEASIBLE[:1])
    with pytest.raises(KeyError):
        informed.predict(other.traffic)


def test_rows_of_their_own_compare_models_that_were_told_alike() -> None:
    moments = moments_of_pairs(*FEASIBLE, *TOO_LATE)
    names = ("idm_calibrated", "gail")
    models = [Predictor.load(name) for name in names]
    results = measured([Predictor.load("idm")], moments, models)
    informed = results["order_handed_in"]
    assert set(results["until_last_seen"]) == {"idm"}
    assert set(informed["until_last_seen"]) == set(informed["models"]) == set(names)
    assert informed["refused"] == dict.fromkeys(names, 1)
    gail, idm = (informed["until_last_seen"][name]["distance_rmse"]["value"] for name in ("gail", "idm_calibrated"))
    ratio = informed["until_last_seen"]["gail"]["distance_rmse_to_idm_calibrated"]
    assert ratio["value"] == pytest.approx(gail / idm)
    assert "gail: refused in 1 moments" in order_handed_in_text(results)
    assert "| GAIL, recorded order handed in |" in order_handed_in_table(results)
    assert "| 1 of 6 |" in order_handed_in_table(results)
