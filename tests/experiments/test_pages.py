"""The README says what the results files say, and the results files what the code computes."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from data.build import build
from experiments.documentation.results import RESULTS, ROOT, filled, readme
from experiments.measure.crossing_order import order_results
from intersection_env import Intersection, Predictor, Scenes
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.moments import moments_of


def test_readme_is_as_the_results_files_make_it() -> None:
    """Regenerate with `make pages`."""
    assert (ROOT / "README.md").read_text() == readme()


def test_errors_file_is_what_the_shipped_recordings_give() -> None:
    """Decisions at a threshold may flip between instruction sets, so the figures agree within 2 %."""
    scenes = build(ROOT / "data" / "recordings", Intersection.load("bendplatz"), ["12", "13", "14"], progress=False)
    moments, _ = moments_of(scenes)
    keys = ["model", "population", "horizon"]
    shipped = pd.read_csv(RESULTS / "errors.csv").set_index(keys).to_dict("index")
    for model in ("constant_velocity", "idm", "gap", "idm_calibrated", "ppo", "gail"):
        fresh = evaluate(Predictor.load(model), moments).set_index(keys).to_dict("index")
        for key, row in fresh.items():
            for figure in ("rmse", "mad", "time_loss_rmse"):
                assert row[figure] == pytest.approx(shipped[key][figure], rel=0.02, abs=0.02), (key, figure)


def test_reports_figures_are_what_the_shipped_policy_gives() -> None:
    """Two of them, recomputed; decisions at a threshold may flip between instruction sets."""
    summary = json.loads((RESULTS / "summary.json").read_text())
    moments, _ = moments_of(Scenes.load("bendplatz").select("validation"))
    gail = Predictor.load("gail")
    at_10s = evaluate(gail, moments).set_index(["population", "horizon"]).to_dict("index")["recorded", 10.0]
    assert at_10s["rmse"] == pytest.approx(summary["distance"]["gail"]["rmse_10s"], rel=0.02)
    assert at_10s["time_loss_rmse"] == pytest.approx(summary["time_loss"]["gail"]["rmse_10s"], rel=0.02)
    order = order_results([gail], moments)["recorded"]["models"]["gail"]
    assert order["accuracy"]["value"] == pytest.approx(summary["order"]["model"], abs=0.005)


def test_a_page_without_its_block_is_refused(tmp_path: Path) -> None:
    assert filled("a\n<!-- begin x -->\nold\n<!-- end x -->\n", {"x": "new"}) == (
        "a\n<!-- begin x -->\nnew\n<!-- end x -->\n"
    )
    with pytest.raises(ValueError, match='one block "y", not 0'):
        filled("a", {"y": "new"})


def test_the_readmes_lines_run(capsys: pytest.CaptureFixture[str]) -> None:
    code = (ROOT / "README.md").read_text().split("```python\n")[1].split("```")[0]
    exec(compile(code, "README.md", "exec"), {})
    assert "total_time_loss" in capsys.readouterr().out
