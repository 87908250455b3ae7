"""Scores of forecasts: right where they are known, and of the samples that they say."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.measure import forecast as measured
from experiments.measure.forecast import calibration_error, figures_of, forecast_results, positions_of
from experiments.measure.forecasters import MeanOverOrders, MostProbableOrder
from experiments.measure.order_chances import OrderChances
from experiments.show.forecast import CHANCES, JOINT, SUMO_RULE, forecast_text, plot_reliability
from intersection_env import Predictor, forecast
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import contested, followed, moments_of
from tests.support.scenes import small_scenes

POLICY = "idm_calibrated"


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 50)


def chances(joint: list[float], truth: list[bool], sumo: list[int]) -> OrderChances:
    """Pairs of one recording and place, all open and recorded, with the same chances by every model."""
    of, count = np.array(joint), len(joint)
    return OrderChances(
        recording=np.full(count, "07"),
        place=np.full(count, "bendplatz"),
        yielder_first=np.array(truth),
        is_open=np.ones(count, np.bool_),
        recorded=np.ones(count, np.bool_),
        sumo=np.array(sumo, np.int8),
        joint=of,
        pair=of,
        boosting=of,
        boosting_pair=of,
        sumo_calibrated=of,
        drawn=of,
    )


def test_scores_are_those_worked_out_by_hand() -> None:
    found = figures_of(chances([0.9, 0.2, 0.6, 0.4], [True, False, False, False], [1, -1, 0, 1]), np.ones(4, np.bool_))
    own = found["models"][JOINT]
    assert own["accuracy"]["value"] == 0.75
    assert found["models"][SUMO_RULE]["accuracy"]["value"] == 0.5, "what SUMO's rule leaves open counts as wrong"
    assert own["accuracy_minus_sumo"]["value"] == 0.25
    assert own["accuracy_minus_priority"]["value"] == 0.0
    assert own["brier"]["value"] == pytest.approx((0.01 + 0.04 + 0.36 + 0.16) / 4)
    assert own["log_loss"]["value"] == pytest.approx(-np.log([0.9, 0.8, 0.4, 0.6]).mean())
    assert [row["count"] for row in found["reliability"]] == [1, 1, 1, 1]
    assert [row["frequency"] for row in found["reliability"]] == [0.0, 0.0, 0.0, 1.0]


def test_settled_pairs_count_for_accuracy_alone() -> None:
    pairs = chances([0.9, 0.9], [True, False], [1, 1])
    pairs.is_open[1] = False
    found = figures_of(pairs, np.ones(2, np.bool_))
    assert (found["pairs"], found["open"]) == (2, 1)
    assert found["models"][JOINT]["accuracy"]["value"] == 0.5
    assert found["models"][JOINT]["open_accuracy"]["value"] == 1.0
    assert found["models"][JOINT]["brier"]["value"] == pytest.approx(0.01)


def test_whoever_is_as_often_right_as_sure_has_no_calibration_error() -> None:
    rows = np.array([(0.8, right) for right in (1.0, 1.0, 1.0, 1.0, 0.0)])
    assert calibration_error(rows) == pytest.approx(0.0)
    rows[:, 1] = 1.0
    assert calibration_error(rows) == pytest.approx(0.2)


def test_scenes_are_measured_and_shown() -> None:
    scenes = [small_scenes("train", "development", each=2)]
    found = forecast_results(Predictor.load(POLICY), scenes, "development")
    every = found["orders"]["all"]
    assert every["pairs"] >= found["orders"]["recorded"]["pairs"]
    assert sum(row["count"] for row in every["reliability"]) == every["open"]
    assert set(every["models"]) == {SUMO_RULE, *CHANCES}
    last = found["positions"]["until_last_seen"]
    assert 0.0 < last["coverage"]["value"] <= 1.0
    assert 0.0 < last["crps"]["value"] < last["median_error"]["value"]
    text = forecast_text(found)
    assert "| bendplatz, all |" in text
    assert len(plot_reliability(found).axes) == 2


def test_interval_of_a_sure_forecast_holds_what_it_says_and_its_crps_is_the_absolute_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All quantiles at one place, which is where the recording is, or a metre beside it."""
    moments = followed(moments_of(small_scenes("development", each=1))[0])[:3]

    class Sure:
        def __init__(self, moment_: object, beside: float) -> None:
            self._recorded, self._beside = moment_.recorded.data, beside  # type: ignore[attr-defined]

        def position_quantiles(self, levels: np.ndarray) -> np.ndarray:
            return np.repeat(self._recorded[None] + np.float32(self._beside), len(levels), axis=0)

    for beside, held in ((0.0, 1.0), (1.0, 0.0)):
        answers = {id(moment.traffic): Sure(moment, beside) for moment in moments}
        monkeypatch.setattr(measured, "forecast", lambda _, traffic, of=answers: of[id(traffic)])
        found = positions_of(Predictor.load(POLICY), moments)["until_last_seen"]
        assert found["coverage"]["value"] == held
        assert found["median_error"]["value"] == pytest.approx(beside, abs=1e-4)
        assert found["crps"]["value"] == pytest.approx(beside, abs=1e-4)


def test_forecasters_predict_the_most_probable_order_and_the_mean() -> None:
    predictor = Predictor.load(POLICY)
    moment = max(
        contested(moments_of(small_scenes("development", each=1))[0]), key=lambda one: len(one.traffic.conflicts)
    )
    likely, mean = MostProbableOrder(predictor), MeanOverOrders(predictor)
    assert {likely.name, mean.name} == {f"{POLICY}_most_probable", f"{POLICY}_mean_over_orders"}
    found = forecast(predictor, moment.traffic, mass=0.999)
    np.testing.assert_array_equal(
        likely.predict(moment.traffic).position, predictor.predict(moment.traffic, found.orders[:1]).position
    )
    position = mean.predict(moment.traffic).position[0]
    np.testing.assert_allclose(position, found.mean_position(), atol=1e-3)
    assert len(found.orders) > 1
