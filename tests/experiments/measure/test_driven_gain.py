"""Realised gains are those of the order that was planned, and what is said of them is what was driven."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from matplotlib.figure import Figure

from experiments.measure.driven_gain import Options, Run, driven_results, main, measured, rows_of_plan
from experiments.measure.driven_plans import LATER, Plan, Promise, jobs_of, plan_of
from experiments.measure.driven_scores import Column, differences, figures_of, ranking_figures
from experiments.models.driven_on import driven_on
from experiments.results_files import rounded
from experiments.show.driven_gain import driven_text, plot_driven
from intersection_env import Predictor, Scenes, rank_maneuvers
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned

BOTH: tuple[Literal["expectation", "prediction"], ...] = ("expectation", "prediction")
SAMPLES = {
    "12": np.array(
        [
            # predicted, realised, later, kept, already, hit, near, hard, the same without, loss, noise, best, chance
            [3.0, 4.0, 5.0, 1, 0, 0, 0, 0, 0, 0, 1, 10.0, 0.1, 6.0, 0.9],
            [2.5, 1.0, 0.5, 1, 0, 0, 1, 1, 0, 0, 1, 10.0, -0.3, np.nan, 0.5],
        ]
    ),
    "13": np.array(
        [
            [4.0, -1.0, -2.0, 0, 0, 1, 1, 0, 0, 1, 0, 20.0, 0.0, 0.0, 0.8],
            [1.0, 2.0, 1.0, 1, 1, 0, 0, 0, 0, 0, 0, 10.0, 0.2, 2.0, 0.1],
        ]
    ),
}


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests of intervals are elsewhere."""
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    return Predictor.load()


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    return thinned(contested(moments_of(Scenes.load("bendplatz").select("development"))[0]), 8)


@pytest.fixture(scope="module")
def plans(predictor: Predictor, moments: list[Moment]) -> list[Plan]:
    return [plan_of(predictor, moment) for moment in moments]


def test_planned_is_the_best_safe_order_of_each_ranking(predictor: Predictor, plans: list[Plan]) -> None:
    for plan in plans:
        for by in BOTH:
            ranked = rank_maneuvers(predictor, plan.moment.traffic, by=by)
            safe = ranked[ranked.safe & ranked.intervention]
            planned = plan.best[by]
            assert planned is not None
            assert planned.gain == pytest.approx(safe.gain.max())
            chance = safe.chance_worthwhile.iloc[0] if by == "expectation" else np.nan
            np.testing.assert_equal(planned.chance, chance)
            assert any((planned[1] == order).all() for order in plan.orders)
        feasible = int(ranked.intervention.sum())
        assert plan.all_driven == (feasible <= 12)
        assert len(plan.orders) == (feasible if plan.all_driven else 1)
    assert {plan.all_driven for plan in plans} == {True, False}


def test_both_rankings_choose_the_same_order_where_all_cooperate(plans: list[Plan]) -> None:
    for plan in plans:
        chosen = [best[1].tolist() for best in plan.best.values() if best is not None]
        assert chosen[0] == chosen[1]
    assert any(len({best[0] for best in plan.best.values() if best is not None}) == 2 for plan in plans)


def test_drivers_and_seed_are_the_same_with_and_without(plans: list[Plan]) -> None:
    one, again = jobs_of(plans[0], 5, 0)
    assert one.orders[0] is None
    assert len(one.orders) == 1 + len(plans[0].orders)
    assert (again.drivers, again.orders, again.steps) == (one.drivers, (None,), LATER)
    assert again.seed != one.seed
    assert jobs_of(plans[0], 5, 0)[0].seed == one.seed
    assert jobs_of(plans[0], 6, 0)[0].drivers != one.drivers


def run(loss: float, crossed: list[int], distance: float = 3.0, unheld: bool = False) -> Run:
    return Run(loss, 2.0 * loss, np.array(crossed, np.int8), distance, 1.0, unheld)


def test_rows_hold_what_was_driven_under_the_planned_order(moments: list[Moment]) -> None:
    orders = tuple(np.array(one, np.int8) for one in ([1, -1], [-1, -1], [1, 1]))
    best = {"expectation": Promise(2.5, orders[1], 0.7), "prediction": None}
    plan = Plan(moments[0], best, orders, True)
    runs = [run(9.0, [1, -1]), run(2.0, [1, -1], -0.1), run(10.0, [-1, 0]), run(5.0, [1, 1], 0.2)]
    found = rows_of_plan(plan, runs, run(9.5, [1, 0]))
    assert list(found) == ["expectation"]
    row = dict(zip(Column, found["expectation"], strict=True))
    assert (row[Column.PREDICTED], row[Column.REALISED], row[Column.LATER]) == (2.5, -1.0, -2.0)
    assert (row[Column.KEPT], row[Column.ALREADY]) == (1.0, 0.0)
    assert (row[Column.LOSS], row[Column.NOISE]) == (9.0, -0.5)
    assert row[Column.BEST] == 4.0  # the first gains 7 s, but collides
    assert row[Column.CHANCE] == 0.7
    assert (row[Column.HIT], row[Column.NEAR], row[Column.HARD]) == (0.0, 0.0, 0.0)
    assert np.isnan(rows_of_plan(plan._replace(all_driven=False), runs, runs[0])["expectation"][Column.BEST])
    for broken in (run(10.0, [1, 0]), run(10.0, [-1, 0], unheld=True)):
        against = rows_of_plan(plan, [*runs[:2], broken, runs[3]], runs[0])
        assert against["expectation"][Column.KEPT] == 0.0


def test_a_run_is_measured_over_10_and_20_s(plans: list[Plan]) -> None:
    job, _ = jobs_of(plans[0], 0, 0)
    driven = driven_on([job._replace(orders=(None,))])[0][0]
    one = measured(job.traffic, driven)
    assert 0.0 < one.loss < one.later
    assert one.braking == pytest.approx(-np.diff(driven.motions.speed, axis=0).min() / 0.2)
    assert len(one.crossed) == len(job.traffic.conflicts)
    still = driven._replace(motions=driven.motions._replace(speed=np.zeros_like(driven.motions.speed)))
    there = driven.motions.present[:50].sum(dtype=np.float64) * 0.2
    assert measured(job.traffic, still).loss == pytest.approx(there, abs=0.2 * len(job.traffic))


def test_figures_are_of_the_moments_asked_for() -> None:
    found = figures_of(SAMPLES)
    assert found is not None
    wanted = {"predicted": 2.625, "realised": 1.5, "later": 1.125, "hit": 0.25, "near": 0.5, "hard": 0.25}
    wanted |= {"hit_without": 0.0, "near_without": 0.25, "hard_without": 0.5, "by_rule": 1.0, "saved": 0.12}
    wanted |= {"regret": 0.75, "regret_always": 0.25}
    assert {name: found[name]["value"] for name in wanted} == pytest.approx(wanted)
    both = np.concatenate(list(SAMPLES.values()))
    assert found["correlation"]["value"] == pytest.approx(np.corrcoef(both[:, 0], both[:, 1])[0, 1], abs=1e-4)
    promised, searched = found["promised"], found["searched"]
    assert promised["moments"] == 3
    assert [promised[name]["value"] for name in ("real", "real_worthwhile", "real_later")] == pytest.approx(
        [2 / 3, 1 / 3, 2 / 3], abs=1e-4
    )
    assert [promised[name]["value"] for name in ("predicted", "realised", "later")] == pytest.approx(
        [9.5 / 3, 4 / 3, 3.5 / 3], abs=1e-4
    )
    likely = found["likely"]
    assert likely["moments"] == 2
    assert (likely["real"]["value"], likely["realised"]["value"]) == (0.5, 1.5)
    assert searched["moments"] == 3
    assert [searched[name]["value"] for name in ("best", "regret", "regret_always")] == pytest.approx(
        [8 / 3, 5 / 3, 1.0], abs=1e-4
    )


def test_orders_that_were_not_kept_are_reported_apart() -> None:
    found = ranking_figures(SAMPLES)
    assert (found["kept"]["value"], found["already"]["value"]) == (0.75, 0.25)
    assert [found[name]["moments"] for name in ("all", "order_kept", "order_not_kept", "already_so")] == [4, 3, 1, 1]
    assert found["order_not_kept"]["realised"]["value"] == -1.0
    assert found["order_kept"]["realised"]["value"] == pytest.approx(7 / 3, abs=1e-4)
    assert found["already_so"]["promised"] is None
    everything = {name: rows[rows[:, Column.KEPT] > 0.0] for name, rows in SAMPLES.items()}
    assert ranking_figures(everything)["order_not_kept"] is None


def test_rankings_are_compared_moment_by_moment() -> None:
    other = {name: rows.copy() for name, rows in SAMPLES.items()}
    other["13"][0, Column.PREDICTED] = 1.0  # does not execute what is no gain
    other["12"][0, Column.REALISED] = 5.0
    found = differences(SAMPLES, other)
    assert found["always"]["value"] == -0.25
    assert found["by_rule"]["value"] == -0.5


def test_results_are_written_printed_and_drawn(
    predictor: Predictor, moments: list[Moment], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figure = tmp_path / "driven.svg"
    assert main(Options(moments=8, seed=2, out=tmp_path, figure=figure)) == 0
    expected = driven_results(predictor, moments, 2)
    content = json.loads((tmp_path / "driven_gain_development.json").read_text(encoding="utf-8"))
    assert content == rounded({"split": "development", **expected})
    assert capsys.readouterr().out.strip() == driven_text(expected)
    assert figure.read_text(encoding="utf-8").startswith("<?xml")
    assert expected["moments"] == 8
    assert expected["rankings"]["expectation"]["all"]["moments"] == len(expected["points"]["expectation"]) == 8
    assert driven_results(predictor, moments, 3)["points"] != expected["points"]


def test_what_is_missing_is_said() -> None:
    assert driven_text({"missing": {"sumo": "not installed"}}) == "Not driven: sumo: not installed."


def test_figure_shows_every_moment() -> None:
    points = {"expectation": [[1.0, 2.0], [3.0, -1.0]], "prediction": [[1.5, 2.0], [2.0, -1.0]]}
    figure = plot_driven({"points": points})
    assert isinstance(figure, Figure)
    for axes, wanted in zip(figure.axes, points.values(), strict=True):
        assert np.asarray(axes.collections[0].get_offsets()).tolist() == wanted


def test_no_moments_and_another_place_are_refused(
    predictor: Predictor, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="no moments with an open conflict"):
        driven_results(predictor, [], 0)
    assert main(Options(scenes=Path("t_junction"), moments=2, out=tmp_path)) == 1
    assert "traffic is on Intersection" in capsys.readouterr().err
    assert main(Options(policy="idm", moments=2, out=tmp_path)) == 1
    assert "order network" in capsys.readouterr().err
