"""The README says what the results files say, and the results files what the code computes."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from data.build import build
from experiments.evaluation import evaluate, starts
from experiments.pages import RESULTS, ROOT, filled, readme
from intersection_env import Intersection, Predictor


def test_readme_is_as_the_results_files_make_it() -> None:
    """Regenerate with `make pages`."""
    assert (ROOT / "README.md").read_text() == readme()


def test_errors_file_is_what_the_shipped_recordings_give() -> None:
    """Decisions at a threshold may flip between instruction sets, so the figures agree within 2 %."""
    scenes = build(ROOT / "data" / "recordings", Intersection.load("bendplatz"), ["12", "13", "14"], progress=False)
    moments, _ = starts(scenes)
    keys = ["model", "population", "horizon"]
    shipped = pd.read_csv(RESULTS / "errors.csv").set_index(keys).to_dict("index")
    for model in ("constant_velocity", "idm", "gap", "idm_calibrated"):
        fresh = evaluate(Predictor.load(model), moments).set_index(keys).to_dict("index")
        for key, row in fresh.items():
            for figure in ("rmse", "mad", "time_loss_rmse"):
                assert row[figure] == pytest.approx(shipped[key][figure], rel=0.02, abs=0.02), (key, figure)


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
