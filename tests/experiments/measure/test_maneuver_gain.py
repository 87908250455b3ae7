"""Gains are those of the best safe order, of the vehicles that cooperate."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from experiments.measure import maneuver_gain
from experiments.measure.maneuver_gain import (
    SHARES,
    Options,
    best_order,
    cooperative_sets,
    main,
    maneuver_results,
)
from experiments.results_files import rounded
from experiments.show.maneuver_gain import gain_table, plot_gain
from intersection_env import Intersection, Predictor, Scene, Scenes, Traffic, Vehicle, crossing_orders, rank_maneuvers
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned
from intersection_env.scenes.scene import Track
from tests.support.twins import random_case


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests of intervals are elsewhere."""
    monkeypatch.setattr(intervals, "RESAMPLES", 20)


@pytest.fixture(scope="module")
def gap() -> Predictor:
    return Predictor.load("gap")


def scene_of(traffic: Traffic, number: int, split: str = "development", steps: int = 11) -> Scene:
    """The vehicles of a traffic at a standstill, as a recording of their own."""
    recording = f"{number:02}"
    tracks = []
    for i, route in enumerate(traffic.route.tolist()):
        place, rest = np.full(steps, traffic.position[i]), np.zeros(steps, np.float32)
        speed, observed = np.full(steps, traffic.speed[i]), np.ones(steps, np.bool_)
        size = float(traffic.length[i]), float(traffic.width[i])
        tracks.append(Track(f"{recording}/{i}", "car", route, *size, 0, place, speed, rest, observed))
    return Scene(f"{recording}/0", recording, split, 0.0, steps, tuple(tracks))


def scenes_of(count: int, split: str = "development") -> Scenes:
    """Random traffics with few orders but more than one, each a recording."""
    bendplatz, scenes = Intersection.load("bendplatz"), list[Scene]()
    seed = 90_000
    while len(scenes) < count:
        traffic, _ = random_case("bendplatz", seed)
        seed += 1
        orders = next(crossing_orders(traffic, batch=200), ())
        if len(traffic.conflicts) and 1 < len(orders) < 200:
            scenes.append(scene_of(traffic, len(scenes), split))
    return Scenes(bendplatz, tuple(scenes), {}, {})


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    return contested(moments_of(scenes_of(8))[0])


def test_vehicles_that_cooperate_at_a_share_do_so_at_all_greater_ones() -> None:
    ids = [f"07/{k}" for k in range(2000)]
    sets = cooperative_sets(ids, np.random.default_rng(3))
    for less, more in itertools.pairwise(sets):
        assert set(less) < set(more)
    assert sets[-1] == ids
    np.testing.assert_allclose([len(one) / len(ids) for one in sets], SHARES, atol=0.04)


def test_best_order_is_the_best_safe_row_of_the_ranking(gap: Predictor, moments: list[Moment]) -> None:
    gains = []
    for moment in moments:
        ranked = rank_maneuvers(gap, moment.traffic)
        default = ranked[~ranked.intervention].iloc[0]
        safe = ranked[ranked.safe]
        best = best_order(gap, moment.traffic, moment.traffic.ids)
        expected = default.total_time_loss - safe.total_time_loss.min() if len(safe) else 0.0
        assert best.gain == pytest.approx(max(0.0, expected), abs=1e-9)
        assert best.worthwhile == (best.gain > 2.0)
        assert best.time_loss == default.total_time_loss
        assert best.orders == sum(len(batch) for batch in crossing_orders(moment.traffic))
        gains.append(best.gain)
    assert max(gains) > 2.0


def test_results_at_all_cooperating_are_those_of_the_ranking(gap: Predictor, moments: list[Moment]) -> None:
    results = maneuver_results(gap, moments, seed=1)
    best = [best_order(gap, moment.traffic, moment.traffic.ids) for moment in moments]
    last = results["shares"][-1]
    gain, lost = np.array([one.gain for one in best]), np.array([one.time_loss for one in best])
    assert last["share"] == 1.0
    assert last["mean_gain"]["value"] == pytest.approx(gain.mean(), abs=1e-4)
    assert last["worthwhile"]["value"] == pytest.approx((gain > 2.0).mean(), abs=1e-4)
    assert last["mean_gain_worthwhile"]["value"] == pytest.approx(gain[gain > 2.0].mean(), abs=1e-4)
    assert last["saved"]["value"] == pytest.approx(gain.sum() / lost.sum(), abs=1e-4)
    counts = [one.orders for one in best]
    assert results["orders"]["counts"] == counts
    assert results["orders"]["max"] == max(counts)
    assert results["orders"]["median"] == np.median(counts)


def test_gain_is_never_negative_even_where_no_order_is_as_good_as_none(gap: Predictor, moments: list[Moment]) -> None:
    results = maneuver_results(gap, moments, seed=1)
    assert all(one["mean_gain"]["low"] >= 0.0 for one in results["shares"])
    traffic, _ = random_case("bendplatz", 91_211)
    plain = Predictor(replace(gap.policy, order_network=None, spread=None), "plain")
    ranked = rank_maneuvers(plain, traffic)
    assert ranked.safe.iloc[0]
    assert ranked.gain.iloc[0] < -1.0  # no intervention is unsafe, and faster
    assert best_order(plain, traffic, traffic.ids).gain == 0.0


def test_no_safe_order_gains_nothing(gap: Predictor, monkeypatch: pytest.MonkeyPatch, moments: list[Moment]) -> None:
    ranked = rank_maneuvers(gap, moments[0].traffic)
    unsafe = ranked.assign(safe=False, worth_executing=False, gain=5.0)
    monkeypatch.setattr(maneuver_gain, "rank_maneuvers", lambda *arguments, **options: unsafe)
    best = best_order(gap, moments[0].traffic, moments[0].traffic.ids)
    assert (best.gain, best.worthwhile) == (0.0, False)


def test_one_vehicle_that_cooperates_alone_gains_nothing(gap: Predictor, moments: list[Moment]) -> None:
    for moment in moments:
        assert best_order(gap, moment.traffic, moment.traffic.ids[:1]).gain == 0.0


def test_orders_beyond_the_limit_are_counted_though_not_predicted(gap: Predictor, moments: list[Moment]) -> None:
    moment = max(moments, key=lambda one: len(one.traffic.conflicts))
    every = best_order(gap, moment.traffic, moment.traffic.ids)
    few = best_order(gap, moment.traffic, moment.traffic.ids, limit=1)
    assert every.orders == few.orders > 1
    assert few.gain <= every.gain


def test_same_seed_gives_the_same_results_and_another_does_not(gap: Predictor, moments: list[Moment]) -> None:
    once, again, other = (maneuver_results(gap, moments, seed) for seed in (1, 1, 2))
    assert json.dumps(once) == json.dumps(again)
    assert once["shares"][4] != other["shares"][4]
    assert once["shares"][-1] == other["shares"][-1]


def test_contested_moments_are_thinned_evenly() -> None:
    bendplatz = Intersection.load("bendplatz")
    alone = Traffic.of(bendplatz, [Vehicle("07/1", "SW-NE", 30.0, 5.0)])
    scenes = scenes_of(9)
    every, _ = moments_of(Scenes(bendplatz, (scene_of(alone, 99), *scenes.scenes), {}, {}))
    chosen = contested(every)
    assert len(chosen) == 9 < len(every)
    assert [moment.scene.recording for moment in thinned(chosen, 5)] == ["00", "02", "04", "06", "08"]
    assert thinned(chosen, 100) == chosen
    assert thinned([], 5) == []
    with pytest.raises(ValueError, match="at least 1, not 0"):
        thinned(every, 0)


def test_no_moments_are_refused(gap: Predictor) -> None:
    with pytest.raises(ValueError, match="no moments with an open conflict"):
        maneuver_results(gap, [], 0)


def test_figure_shows_every_share_and_every_moment(gap: Predictor, moments: list[Moment]) -> None:
    results = maneuver_results(gap, moments, seed=1)
    figure = plot_gain(results)
    assert isinstance(figure, Figure)
    gain, orders = figure.axes
    mean = np.asarray(gain.lines[0].get_xydata())
    np.testing.assert_allclose(mean[:, 0], 100.0 * np.array(SHARES))
    np.testing.assert_allclose(mean[:, 1], [one["mean_gain"]["value"] for one in results["shares"]])
    counts, share = np.asarray(orders.lines[0].get_xydata()).T
    assert counts.tolist() == sorted(results["orders"]["counts"])
    for count in set(counts.tolist()):
        reached = 100.0 * np.mean(np.array(results["orders"]["counts"]) >= count)
        assert share[counts == count][0] == pytest.approx(reached)


def test_results_of_the_split_asked_for_are_written_printed_and_drawn(
    gap: Predictor, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, other = scenes_of(3), scenes_of(5, "validation")
    kept = Scenes(own.intersection, (*own.scenes, *other.scenes[3:]), {}, {})
    kept.save(tmp_path / "scenes.npz")
    figure = tmp_path / "maneuvers.svg"
    options = Options(
        (tmp_path / "scenes.npz",), policy="gap", moments=3, limit=20, seed=3, out=tmp_path, figure=figure
    )
    assert main(options) == 0
    expected = maneuver_results(gap, thinned(contested(moments_of(own)[0]), 3), 3, 20)
    content = json.loads((tmp_path / "maneuvers_development.json").read_text(encoding="utf-8"))
    assert content == rounded({"split": "development", **expected})
    assert capsys.readouterr().out.strip() == gain_table(expected)
    assert figure.read_text(encoding="utf-8").startswith("<?xml")


def test_missing_scenes_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(scenes=(Path("nowhere.npz"),))) == 1
    assert "nowhere.npz" in capsys.readouterr().err
