"""The errors over the horizon are what a hand computes, and models are compared on the same samples."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.measure.horizon import Options, horizon_results, main
from experiments.show.horizon import MODELS, errors_table, errors_text, plot_errors, until_last_seen_table
from intersection_env import Predictor, Scenes
from intersection_env.evaluation.errors import Errors, evaluate
from intersection_env.evaluation.moments import moments_of
from tests.support.scenes import small_scenes

TIMES = 51


def made(distance: list[float], recording: list[str], recorded: list[bool] | None = None, scale: float = 1.0) -> Errors:
    """Errors that grow with time; that of time loss is a tenth of that of distance."""
    growth = np.linspace(0.0, 1.0, TIMES)[:, None]
    errors = scale * growth * np.array(distance)
    shape = errors.shape
    known = np.ones(shape[1], np.bool_) if recorded is None else np.array(recorded)
    scored = np.ones(shape, np.bool_)
    scored[0] = known
    behind, recorded_behind = (np.ma.masked_array(np.full(shape, speed), ~scored) for speed in (4.0, 8.0))
    return Errors(errors, 0.1 * errors, scored, known, behind, recorded_behind, np.array(recording))


def test_figures_are_those_of_the_samples_of_a_population() -> None:
    results = horizon_results({"a": made([1.0, -3.0, 100.0, 2.0], list("xxxy"), [True, True, False, True])})
    recorded = results["models"]["a"]["recorded"]
    assert recorded["count"] == [3] * TIMES
    assert recorded["distance"]["rmse"][-1] == pytest.approx(np.sqrt(14.0 / 3.0))
    assert recorded["distance"]["rmse"][25] == pytest.approx(0.5 * np.sqrt(14.0 / 3.0))
    assert recorded["distance"]["mad"][-1] == pytest.approx(2.0)
    assert recorded["distance"]["median_deviation"][-1] == pytest.approx(1.0)  # of 1, -3, 2 from 1
    assert recorded["distance"]["bias"][-1] == pytest.approx(0.0)
    assert recorded["time_loss"]["mad"][-1] == pytest.approx(0.2)
    assert results["models"]["a"]["extrapolated"]["distance"]["rmse"][-1] == pytest.approx(100.0)
    assert results["time"][-1] == 10.0


def test_times_without_samples_are_left_open() -> None:
    found = made([1.0, 2.0], ["x", "y"])
    found.scored[10:50] = False
    results = horizon_results({"a": found})
    of_model = results["models"]["a"]
    recorded, last_seen = of_model["recorded"], of_model["last_seen"]
    assert recorded["count"][9:12] == [2, 0, 0]
    assert recorded["distance"]["rmse"][20] is None
    assert recorded["distance"]["rmse"][50] is not None
    assert last_seen["horizon"] == [2.0, 4.0, 6.0, 8.0, 10.0]
    assert last_seen["count"] == [0, 0, 0, 0, 2]
    assert last_seen["distance"]["rmse"][:4] == [None] * 4
    assert of_model["extrapolated"]["distance"] == {}
    assert results["at_4s"]["a"]["distance_rmse"] is None


def test_each_is_scored_at_the_moment_at_which_it_was_last_seen() -> None:
    found = made([1.0, -3.0, 100.0, 2.0], list("xxxy"), [True, True, False, True])
    found.scored[26:, 1] = False  # leaves after 5 s, at half its error
    results = horizon_results({"a": found, "constant_velocity": made([2.0] * 4, list("xxxy"))})
    of_model = results["models"]["a"]
    assert of_model["until_last_seen"]["count"] == 3
    assert of_model["until_last_seen"]["distance"]["bias"] == pytest.approx((1.0 - 1.5 + 2.0) / 3.0)
    assert of_model["until_last_seen"]["distance"]["mad"] == pytest.approx(1.5)
    assert of_model["last_seen"]["count"] == [0, 0, 1, 0, 2]
    assert of_model["last_seen"]["distance"]["bias"][2] == pytest.approx(-1.5)
    assert of_model["speed_behind"] == {"predicted": 4.0, "recorded": 8.0}
    row = results["until_last_seen"]["a"]
    assert row["distance_rmse"]["value"] == pytest.approx(np.sqrt((1.0 + 1.5**2 + 4.0) / 3.0))
    assert row["distance_bias"]["value"] == pytest.approx(0.5)
    assert results["at_10s"]["a"]["distance_bias"]["value"] == pytest.approx(1.5)  # of 1 and 2: who left is not there


def test_errors_after_4_s_are_those_of_who_is_recorded_then() -> None:
    found = made([1.0, -3.0, 100.0, 2.0], list("xxxy"), [True, True, False, True])
    found.scored[21:, 1] = False  # leaves after 4 s
    results = horizon_results({"a": found})
    assert results["at_4s"]["a"]["distance_rmse"]["value"] == pytest.approx(0.4 * np.sqrt(14.0 / 3.0))
    assert results["at_4s"]["a"]["distance_mad"]["value"] == pytest.approx(0.4 * 2.0)
    assert results["at_10s"]["a"]["distance_rmse"]["value"] == pytest.approx(np.sqrt(5.0 / 2.0))


def test_ratios_are_to_the_references_asked_for() -> None:
    errors, recordings = [1.0, 2.0, 30.0, 60.0], list("xxyy")
    both = {"a": made(errors, recordings, scale=0.5), "b": made(errors, recordings)}
    assert not any("_to_" in key for key in horizon_results(both)["until_last_seen"]["a"])
    found = horizon_results(both, ("b",))["until_last_seen"]
    assert found["a"]["distance_rmse_to_b"]["value"] == pytest.approx(0.5)
    assert not any("_to_" in key for key in found["b"])


def test_model_without_rows_is_left_out_of_the_pages_tables() -> None:
    moments = moments_of(small_scenes("development"))[0]
    table = pd.concat([evaluate(Predictor.load(model), moments) for model in ("idm", "gap")])
    for shown in (until_last_seen_table(table), errors_table(table)):
        assert [line.split(" | ")[0].removeprefix("| ") for line in shown.splitlines()[2:]] == [
            *(MODELS[model] for model in ("idm", "gap")),
            "samples",
        ]


def test_ratio_to_a_reference_is_paired() -> None:
    """Recordings differ much, the ratio of the two models in each not at all: no doubt about the ratio."""
    errors, recordings = [1.0, 2.0, 30.0, 60.0], list("xxyy")
    results = horizon_results({"a": made(errors, recordings, scale=0.5), "idm": made(errors, recordings)})
    ratio = results["at_10s"]["a"]["distance_rmse_to_idm"]
    assert ratio == pytest.approx({"value": 0.5, "low": 0.5, "high": 0.5})
    alone = results["at_10s"]["a"]["distance_rmse"]
    assert alone["low"] < 0.5 * alone["value"]
    assert not any("_to_" in key for key in results["at_10s"]["idm"])


def test_main_measures_the_shipped_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenes = Scenes.load("bendplatz").select("development")
    replace(scenes, scenes=scenes.scenes[:2]).save(tmp_path / "scenes.npz")
    options = Options(
        (tmp_path / "scenes.npz",),
        policies=("idm", "constant_velocity"),
        order_handed_in=("idm",),
        forecasting=("gap",),
        patient=("gap",),
        out=tmp_path,
        figure=tmp_path / "a.svg",
    )
    assert main(options) == 0
    results = json.loads((tmp_path / "horizon_development.json").read_text())
    forecasts = {"gap_patience_kept", "gap_most_probable", "gap_mean_over_orders"}
    assert set(results["models"]) == {"idm", "constant_velocity", *forecasts}
    assert set(results["order_handed_in"]["models"]) == {"idm"}
    assert results["moments"] > 3
    assert "constant_velocity" in capsys.readouterr().out
    assert (tmp_path / "a.svg").stat().st_size > 1000


def test_table_of_the_pages_shows_each_model_by_when_vehicles_were_last_seen() -> None:
    moments = moments_of(small_scenes("development"))[0]
    table = pd.concat([evaluate(Predictor.load(model), moments) for model in MODELS])
    head, _, *rows, samples = until_last_seen_table(table).splitlines()
    assert "to 2 s | to 4 s | to 6 s | to 8 s | to 10 s | at any time" in head
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(MODELS.values())
    steady = table[(table["model"] == "constant_velocity") & (table["population"] == "until_last_seen")].iloc[0]
    figures = f"{steady['rmse']:.1f} / {steady['mad']:.1f} / {steady['bias']:+.1f}"
    assert f"| {figures} | {steady['speed_behind']:.1f}, {steady['recorded_speed_behind']:.1f} |" in rows[0]
    counts = [int(cell) for cell in samples.strip("| ").split(" | ")[1:]]
    assert sum(counts[:-1]) == counts[-1] == steady["count"]


def test_figure_has_a_line_a_model_for_both_figures() -> None:
    results = horizon_results({"a": made([1.0, 2.0], ["x", "y"]), "b": made([2.0, 1.0], ["x", "y"])})
    figure = plot_errors(results, {"b": "the second"})
    first = figure.axes[0]
    assert first.lines[0].get_label() == "the second"
    np.testing.assert_allclose(
        np.asarray(first.lines[0].get_ydata()), results["models"]["b"]["recorded"]["distance"]["rmse"]
    )


def test_no_moment_to_predict_from_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenes = Scenes.load("bendplatz")
    replace(scenes, scenes=()).save(tmp_path / "scenes.npz")
    assert main(Options((tmp_path / "scenes.npz",), policies=("idm",), out=tmp_path)) == 1
    assert 'no scene of split "development"' in capsys.readouterr().err
    replace(scenes, scenes=scenes.select("development").scenes[:1]).save(tmp_path / "scenes.npz")
    assert main(Options((tmp_path / "scenes.npz",), policies=("hero",), out=tmp_path)) == 1
    assert 'no policy "hero"' in capsys.readouterr().err


def test_ratio_to_a_model_without_error_is_undefined() -> None:
    right = made([0.0, 0.0, 0.0, 0.0], list("xxyy"), [True] * 4)
    wrong = made([1.0, -2.0, 3.0, 4.0], list("xxyy"), [True] * 4)
    found = horizon_results({"constant_velocity": right, "gail": wrong})
    assert found["until_last_seen"]["gail"]["distance_rmse_to_constant_velocity"] is None
    assert found["until_last_seen"]["gail"]["distance_rmse"]["value"] > 0.0
    assert "gail" in errors_text(found)
