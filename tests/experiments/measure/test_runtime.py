"""The runtimes of the predictor are those of the scenes, models and machine that the results name."""

from __future__ import annotations

import gc
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.bench.own_process import NOT_INSTALLED
from experiments.bench.predictor import SIZES
from experiments.measure import runtime, runtime_libsumo, timed_calls
from experiments.measure.runtime import Options, fit, main, random_scenes, runtime_results
from experiments.measure.timed_calls import milliseconds
from experiments.show.runtime import LOOKS, plot_runtimes, runtimes_text
from intersection_env import _core
from intersection_env.traffic import FLOAT_FIELDS

OURS = ("ours", "ours, batch", "IDM", "IDM, batch")
LIBSUMO = ("libsumo", "libsumo, steps alone")
ROW = {"vehicles": {"2": {"mean": 1.0, "median": 0.5, "calls": 3}, "3": {"mean": 2.0, "median": 1.5, "calls": 3}}}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process of libsumo's, little of torch, and a machine whose speed is known."""
    theirs = {name: ROW | {"doing": "its own"} for name in LIBSUMO}
    monkeypatch.setattr(runtime, "in_own_process", lambda *_: theirs)
    monkeypatch.setattr(runtime, "reference_rate", lambda: {"median": 80.0, "least": 79.0, "best": 81.0})
    for name, value in {"TURN": 2, "TORCH_SIZES": (2, 4), "TORCH_SCENES": 1, "TORCH_REPEATS": 1}.items():
        monkeypatch.setattr(runtime, name, value)
    monkeypatch.setattr(timed_calls, "WARM_UP", 1)


def test_scenes_have_so_many_vehicles_and_are_the_same_each_time() -> None:
    first, again, other = (list(random_scenes(3, seed)) for seed in (0, 0, 1))
    for scene, same in zip(first, again, strict=True):
        assert {size: len(traffic) for size, traffic in scene.items()} == {size: size for size in SIZES}
        for size in SIZES:
            for name in ("route", *FLOAT_FIELDS):
                np.testing.assert_array_equal(getattr(scene[size], name), getattr(same[size], name))
    assert not np.array_equal(first[0][15].position, other[0][15].position)


def test_no_vehicles_of_a_scene_overlap_and_each_number_adds_one_to_those_before() -> None:
    for scene in random_scenes(3, 0):
        for size, traffic in scene.items():
            closest = _core.closest(traffic.intersection.core, traffic.core)
            assert closest is None or closest[0] >= 0.0
            if size > SIZES[0]:
                assert set(scene[size - 1].ids) < set(traffic.ids)


def test_calls_are_timed_once_each_after_some_that_warm_up_and_without_garbage_collection() -> None:
    seen: list[tuple[int, bool]] = []
    found = milliseconds([lambda k=k: seen.append((k, gc.isenabled())) for k in range(3)])  # type: ignore[misc]
    assert seen == [(0, False), (0, False), (1, False), (2, False)]
    assert len(found) == 3
    assert min(found) > 0.0
    assert gc.isenabled()


@pytest.mark.parametrize("degree", [1, 2])
def test_fit_finds_the_coefficients_and_explains_all(degree: int) -> None:
    coefficients = [3.0, -0.5, 0.25][: degree + 1]
    found = fit({n: sum(c * n**power for power, c in enumerate(coefficients)) for n in SIZES}, degree)
    np.testing.assert_allclose(found["coefficients"], coefficients, atol=1e-9)
    assert found["explained"] == pytest.approx(1.0)


def test_fit_explains_the_share_of_variance_counted_by_hand() -> None:
    assert fit({1: 0.0, 2: 3.0, 3: 0.0}, 1)["explained"] == pytest.approx(0.0)
    assert fit({1: 0.0, 2: 3.0, 3: 3.0}, 1)["explained"] == pytest.approx(0.75)  # slope 1.5: 4.5 of 6 in squares


def test_results_hold_every_model_the_machine_and_what_follows() -> None:
    results = runtime_results(Options(scenes=3))
    assert list(results["models"]) == [*OURS, *LIBSUMO, "torch"]
    for name in OURS:
        rows = results["models"][name]["vehicles"]
        assert list(rows) == [str(size) for size in SIZES]
        assert all(row["calls"] == 3 and row["mean"] > 0.0 and row["median"] > 0.0 for row in rows.values())
    assert list(results["models"]["torch"]["vehicles"]) == ["2", "4"]
    pairs = np.mean([len(scene[15].conflicts) for scene in random_scenes(3, 0)])
    assert results["pairs"]["15"] == pytest.approx(pairs)
    batch = results["models"]["ours, batch"]["vehicles"]["15"]["mean"]
    assert results["maneuvers_per_cycle"] == int(200.0 / batch)
    means = {size: results["models"]["ours"]["vehicles"][str(size)]["mean"] for size in SIZES}
    assert results["fits"]["ours"]["mean"]["quadratic"] == fit(means, 2)
    assert (results["isa"], results["steps"]) == (_core.kernel_name(), 50)
    assert results["core_share"] > 0.0
    assert [one["median"] for one in results["reference_gflops"]] == [80.0, 80.0]
    assert json.loads(json.dumps(results)) == results


def test_batch_is_timed_by_the_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime, "milliseconds", lambda calls: [64.0] * len(calls))
    models = runtime.core_times({name: lambda _: lambda: None for name in OURS}, Options(scenes=1))["models"]
    assert [models[name]["vehicles"]["2"]["mean"] for name in OURS] == [64.0, 1.0, 64.0, 1.0]


def test_missing_peer_is_reported_not_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime, "in_own_process", lambda *_: {"missing": "not installed"})
    results = runtime_results(Options(scenes=1))
    assert all(results["models"][name] == {"missing": "not installed"} for name in LIBSUMO)
    assert "libsumo: not installed" in runtimes_text(results)
    labels = [line.get_label() for line in plot_runtimes(results).axes[0].lines]
    assert len(labels) == len(LOOKS) - 2
    assert not any("libsumo" in str(label) for label in labels)


def test_process_without_libsumo_says_so_by_its_exit_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> dict[str, Any]:
        raise ModuleNotFoundError("No module named 'libsumo'")

    monkeypatch.setattr(runtime_libsumo, "libsumo_times", missing)
    assert runtime_libsumo.main() == NOT_INSTALLED


def test_figure_has_a_line_a_model_and_the_papers_point() -> None:
    results = runtime_results(Options(scenes=1))
    figure = plot_runtimes(results)
    (axes,) = figure.axes
    assert [line.get_label() for line in axes.lines] == [label.format(batch=64) for label, _, _ in LOOKS.values()]
    assert axes.get_yscale() == "log"
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), [[15.0, 3.5]])
    assert figure.get_size_inches()[0] == 3.5


def test_main_writes_results_and_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(scenes=1, out=tmp_path, figure=tmp_path / "runtime.pdf")) == 0
    results = json.loads((tmp_path / "runtime.json").read_text())
    assert f"maneuvers in 200 ms: {results['maneuvers_per_cycle']}; paper: over 50" in capsys.readouterr().out
    picture = (tmp_path / "runtime.pdf").read_bytes()
    assert picture.startswith(b"%PDF")
    assert b"/Type3" not in picture


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (Options(scenes=0), "--scenes is 0; wanted at least 1"),
        (Options(policy="gap"), 'the policy "gap" lacks a network; wanted one with both'),
        (Options(policy="none"), 'no policy "none"'),
        (Options(policy="none.policy"), "none.policy"),
    ],
)
def test_bad_options_are_named_and_nothing_is_written(
    options: Options, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(options) == 1
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
