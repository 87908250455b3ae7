"""The pages say what the results files say, and these what the code computes; code on pages runs, links lead on."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import gymnasium
import pandas as pd
import pytest

import intersection_env
from agents.export import main as export
from data.build import build
from experiments.documentation.results import PAGE, README, RESULTS, ROOT, filled, page, readme, with_tables
from experiments.measure.crossing_order import order_results
from intersection_env import Intersection, Predictor, Scenes
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.moments import moments_of

DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [
    README,
    *DOCS,
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    ROOT / "experiments" / "README.md",
    ROOT / "findings" / "README.md",
    RESULTS / "report.md",
]
LINK = re.compile(r"\]\(([^)\s]+)\)|src=\"([^\"]+)\"")
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
LONGEST = 120  # characters of a line of prose; tables and code may be longer


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_pages_are_as_the_results_files_make_them() -> None:
    """Regenerate with `python -m experiments.documentation.results`."""
    assert README.read_text() == readme()
    assert PAGE.read_text() == page()


def test_errors_file_is_what_the_shipped_recordings_give() -> None:
    """Decisions at a threshold may flip between instruction sets, so the figures agree within 2 %."""
    scenes = build(ROOT / "data" / "recordings", Intersection.load("bendplatz"), ["12", "13", "14"], progress=False)
    moments, _ = moments_of(scenes)
    keys = ["model", "population", "horizon"]
    shipped = pd.read_csv(RESULTS / "errors.csv").set_index(keys).to_dict("index")
    for model in pd.read_csv(RESULTS / "errors.csv")["model"].unique():
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


def test_a_page_without_its_block_is_refused() -> None:
    assert filled("a\n<!-- begin x -->\nold\n<!-- end x -->\n", {"x": "new"}) == (
        "a\n<!-- begin x -->\nnew\n<!-- end x -->\n"
    )
    with pytest.raises(ValueError, match='one block "y", not 0'):
        filled("a", {"y": "new"})


def test_a_template_without_a_place_for_each_table_is_refused() -> None:
    assert with_tables("a {{x}}\nb {{y}}", {"y": "2", "x": "1"}) == "a 1\nb 2"
    for template in ("{{x}}", "{{x}} {{y}} {{z}}", "{{x}} {{y}} {{y}}"):
        with pytest.raises(ValueError, match="the template has places for x"):
            with_tables(template, {"x": "1", "y": "2"})


@pytest.mark.parametrize("path", [README, *DOCS], ids=name_of)
def test_code_on_a_page_runs_and_prints_what_follows_it(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A block of Python goes on from the ones before it; a block of text right after it is what it prints."""
    if path.name == "export.md":  # it goes on from a command
        monkeypatch.chdir(tmp_path)
        assert export(["rollout_gradient", "--network", "driving", "--to", "onnx", "--out", "driving.onnx"]) == 0
        capsys.readouterr()
    namespace: dict[str, Any] = {}
    for code, printed in re.findall(r"```python\n(.*?)```\n(?:```text\n(.*?)```)?", path.read_text(), re.DOTALL):
        exec(compile(code, path.name, "exec"), namespace)
        found = capsys.readouterr().out
        assert not printed or found == printed, f"it prints now:\n{found}"


def test_calls_that_the_readme_names_make_environments() -> None:
    section = README.read_text().split("## The environments\n")[1].split("\n\n")[0]
    names = {"gymnasium": gymnasium, "intersection_env": intersection_env}
    calls = re.findall(r"^- `(.*?)`: ", section, flags=re.MULTILINE)
    kinds = [type(getattr(made := eval(call, names), "unwrapped", made)).__name__ for call in calls]
    assert kinds == ["Replay", "ClosedLoop", "ClosedLoopWorlds"]


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_links_of_a_page_lead_to_files_and_headings_that_are_there(path: Path) -> None:
    for target in linked(path.read_text()):
        file, _, heading = target.partition("#")
        there = path if not file else (path.parent / file).resolve()
        assert there.exists(), f"{target}: there is no {file}"
        assert not heading or heading in headings(there.read_text()), f"{target}: no such heading"


def linked(text: str) -> list[str]:
    """Where a page's links and pictures lead, but for those to the web."""
    targets = [one or other for one, other in LINK.findall(FENCE.sub("", text))]
    return [target for target in targets if not target.startswith(("http://", "https://"))]


def headings(text: str) -> set[str]:
    """The anchors that GitHub gives to a page's headings."""
    titles = re.findall(r"^#+ (.*)$", FENCE.sub("", text), flags=re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles]
    return {
        title if plain[:k].count(title) == 0 else f"{title}-{plain[:k].count(title)}" for k, title in enumerate(plain)
    }


def test_headings_have_the_anchors_that_github_gives_them() -> None:
    assert headings("# A `b`, c's (d)\n\n```sh\n# no heading\n```\n## Two\n## Two\n") == {"a-b-cs-d", "two", "two-1"}
    assert linked('[a](b.md#c) `x` ![d](e.png) <img src="f.png"> [g](https://h)') == ["b.md#c", "e.png", "f.png"]


def test_every_page_of_the_documentation_is_found_from_the_first_screen() -> None:
    first_screen = README.read_text().split("\n## ")[0]
    assert "docs/index.md" in linked(first_screen)
    index = ROOT / "docs" / "index.md"
    found = {(index.parent / target.split("#")[0]).resolve() for target in linked(index.read_text())}
    assert found >= set(DOCS) - {index}


@pytest.mark.parametrize("path", [page for page in PAGES if page.name != "report.md"], ids=name_of)
def test_lines_of_prose_fit_the_screen(path: Path) -> None:
    lines = FENCE.sub("", path.read_text()).splitlines()
    assert [line for line in lines if len(line) > LONGEST and not line.startswith(("|", "<img"))] == []


def test_citation_names_the_version_of_the_package() -> None:
    stated = re.findall(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), flags=re.MULTILINE)
    assert stated == [tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]]
