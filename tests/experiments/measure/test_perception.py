"""What errors of perception do: nothing where there are none, and what is worked out by hand where there are."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.measure import perception
from experiments.measure.perception import Options, main, perception_results, seen_with
from experiments.measure.perception_choices import Choice, choices_of, expected_time_loss
from experiments.measure.perception_scores import Sample, figures_of, sample_of
from experiments.show.perception import AWARE, UNAWARE, perception_text, plot_perception
from intersection_env import Noise, Predictor, Traffic, Vehicle, forecast, rank_maneuvers
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import contested, moments_of
from tests.support.busy_traffic import T
from tests.support.forecasts import few
from tests.support.scenes import small_scenes


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor.load("idm_calibrated")


def test_without_errors_the_best_maneuver_is_chosen(predictor: Predictor) -> None:
    (choice,) = choices_of(predictor, few(), few(), None).values()
    assert choice == Choice(same=True, refused=False, unsafe=False, regret=0.0)


def test_a_choice_made_of_another_traffic_is_judged_by_this_one(predictor: Predictor) -> None:
    """Seen is "side" so near that it goes first; it is farther away."""
    table = rank_maneuvers(predictor, few())
    totals = dict(zip(table["order"], table["total_time_loss"], strict=True))
    seen = replace(few(), position=np.array([40.0, 79.0, 135.0], np.float32))
    best_seen = rank_maneuvers(predictor, seen).iloc[0]
    choice = choices_of(predictor, few(), seen, None)[UNAWARE]
    assert choice.same == (best_seen["order"] == table["order"][0])
    assert choice.regret == pytest.approx(totals[best_seen["order"]] - table["total_time_loss"][0], abs=1e-4)


def test_a_plan_that_cannot_be_carried_out_is_no_intervention(predictor: Predictor) -> None:
    """One of both can no longer stop."""
    line = T.routes[T.route_index("E-S")].stop_line
    traffic = Traffic.of(T, [Vehicle("left", "E-S", line - 3.0, 12.0), Vehicle("main", "W-E", 90.0, 12.0)])
    plain = rank_maneuvers(predictor, traffic)
    lost, refused, unsafe = expected_time_loss(predictor, traffic, (("main", "left"),))
    assert refused
    assert not unsafe
    assert lost == pytest.approx(plain.loc[~plain["intervention"], "total_time_loss"].item(), abs=1e-4)


def test_who_knows_of_the_errors_chooses_among_what_was_seen(predictor: Predictor) -> None:
    choices = choices_of(predictor, few(), few(), Noise(0.0, 0.0, draws=2))
    assert choices[AWARE] == choices[UNAWARE]


def test_figures_are_those_worked_out_by_hand() -> None:
    choice = Choice(same=True, refused=False, unsafe=False, regret=1.0)
    one = Sample("07", np.array([[1.0, 0.01], [0.0, 0.49]]), np.array([3.0, -4.0]), np.array([[1.0, 1.0]]), choice)
    other = Sample("08", np.array([[1.0, 0.1]]), np.zeros(0), np.array([[-2.0, 0.0]]), choice._replace(same=False))
    found = {name: row["value"] for name, row in figures_of([one, other]).items() if row is not None}
    assert found["accuracy"] == pytest.approx(2.0 / 3.0)
    assert found["brier"] == pytest.approx(0.2)
    assert found["rmse_10s"] == pytest.approx(np.sqrt(12.5))
    assert found["mad_seen"] == pytest.approx(1.5)
    assert found["coverage_seen"] == 0.5
    assert (found["same"], found["regret"]) == (0.5, 1.0)


def test_sample_of_a_moment_without_errors_is_its_forecasts(predictor: Predictor) -> None:
    moment = contested(moments_of(small_scenes("development", each=1))[0])[0]
    choice = Choice(same=True, refused=False, unsafe=False, regret=0.0)
    found = forecast(predictor, moment.traffic)
    sample = sample_of(moment, found, choice)
    last = moment.last_seen()
    who = np.flatnonzero(~np.ma.getmaskarray(last))
    errors = found.mean_position()[last.data[who], who] - moment.recorded.data[last.data[who], who]
    np.testing.assert_allclose(sample.seen[:, 0], errors)


def test_errors_of_two_sizes_differ_by_their_size() -> None:
    traffic = few()
    one, two = (
        seen_with(traffic, Noise(size, size), np.random.default_rng(3)).position - traffic.position
        for size in (0.25, 0.5)
    )
    np.testing.assert_allclose(two, 2.0 * one, atol=1e-4)
    queue = Traffic.of(T, [Vehicle(f"q{k}", "W-E", 20.0 + 5.0 * k, 0.0) for k in range(10)])
    with pytest.raises(ValueError, match=r"no traffic with such errors in 100 draws; of the last one: .*overlap"):
        seen_with(queue, Noise(10.0, 0.0), np.random.default_rng(0))


def test_scenes_are_measured_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perception, "SIZES", ((0.0, 0.0), (0.5, 0.5), (2.0, 2.0)))
    small_scenes("development", each=2).save(tmp_path / "scenes.npz")
    options = Options((tmp_path / "scenes.npz",), moments=6, out=tmp_path, figure=tmp_path / "a.svg")
    assert main(options) == 0
    found = json.loads((tmp_path / "perception_development.json").read_text(encoding="utf-8"))
    assert AWARE not in found["sizes"][0]
    none, _, large = found["sizes"]
    assert none[UNAWARE]["same"]["value"] == 1.0
    assert large[UNAWARE]["rmse_seen"]["value"] > none[UNAWARE]["rmse_seen"]["value"]
    text = perception_text(found)
    assert "| 0.5, 0.5 | knows of it |" in text
    assert len(plot_perception(found).axes) == 6
    assert (tmp_path / "a.svg").stat().st_size > 1000


def test_no_moments_are_refused(predictor: Predictor) -> None:
    with pytest.raises(ValueError, match="no moments with an open conflict to see with errors"):
        perception_results(predictor, [], 0)
