"""Makes docs/results.md and the figures of the README from the results files: no figure enters a page by hand.

python -m experiments.documentation.results (`make pages` first makes the results anew)

The page's prose stands in `results_page.md` beside this file, with {{name}} where a table goes.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.report.baseline import baselines_in, baselines_table
from experiments.report.headlines import headlines
from experiments.results_files import results_in
from experiments.show.against import against_table
from experiments.show.environment_speed import environments_section, training_sentence
from experiments.show.forecast import forecast_text
from experiments.show.gap import accuracy_table
from experiments.show.horizon import errors_table, until_last_seen_table
from experiments.show.perception import perception_text
from experiments.show.predictor_speed import speed_section
from experiments.show.tables import markdown_table
from intersection_env.command import run_command
from intersection_env.files import written_whole

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "experiments" / "results"
README, PAGE = ROOT / "README.md", ROOT / "docs" / "results.md"
TEMPLATE = Path(__file__).with_name("results_page.md")
FIGURES = {
    "maneuvers in 200 ms": "scenarios predicted in 200 ms, each by itself (15 vehicles, one core)",
    "crossing order right": "pairs that cross in the predicted order",
    "... its RMSE to constant velocity's": "the default's distance error until last seen, to constant velocity's",
}
"""The README's, of the headlines, and what they are called there."""


def filled(page: str, blocks: dict[str, str]) -> str:
    """The page with each block's text between `<!-- begin NAME -->` and `<!-- end NAME -->`.

    Raises:
        ValueError: the page lacks a block's marks.
    """
    for name, text in blocks.items():
        pattern = re.compile(rf"(<!-- begin {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
        page, found = pattern.subn(lambda mark, text=text: f"{mark[1]}{text}\n{mark[2]}", page)  # type: ignore[misc]
        if found != 1:
            raise ValueError(f'the page must hold one block "{name}", not {found}')
    return page


def figures_section(results: dict[str, Any]) -> str:
    """The README's figures, and how many of our bars are met."""
    rows = list(headlines(results))
    named = {row.what: row for row in rows}
    heads = ("figure", "paper, on inD", "ours, simulated, 95 % interval", "our bar", "command")
    figures = markdown_table(heads, [(name, *named[what].cells()[1:]) for what, name in FIGURES.items()])
    judged = [row.met for row in rows if row.met is not None]
    met = f"Of {len(judged)} bars that we set ourselves {sum(judged)} are met ([all](docs/results.md))."
    return f"{figures}\n\n{met}"


def paper_table(results: dict[str, Any]) -> str:
    """The paper's figures with ours beside them."""
    heads = ("figure", "paper, on inD", "ours, with 95 % interval", "our bar")
    return markdown_table(heads, [row.cells()[:-1] for row in headlines(results)])


def page() -> str:
    """The page of results as the results files make it.

    Raises:
        ValueError: the template names another table than those there are.
    """
    bench = json.loads((RESULTS / "bench.json").read_text(encoding="utf-8"))
    results, errors = results_in(RESULTS), pd.read_csv(RESULTS / "errors.csv")
    tables = {
        "paper": paper_table(results),
        "baselines": baselines_table(baselines_in(RESULTS), results),
        "errors": errors_table(errors),
        "until_last_seen": until_last_seen_table(errors),
        "gap": accuracy_table(results["gap_validation"]),
        "forecasts": forecast_text(results["forecast_validation"]),
        "perception": perception_text(results["perception_validation"]),
        "speed": speed_section(bench),
        "environments": environments_section(bench["environments"]),
        "against": against_table(json.loads((RESULTS / "against.json").read_text(encoding="utf-8"))),
    }
    if "training" in bench:
        tables["environments"] += f"\n\n{training_sentence(bench['training'])}"
    return with_tables(TEMPLATE.read_text(encoding="utf-8"), tables)


def with_tables(template: str, tables: dict[str, str]) -> str:
    """The template with each {{name}} replaced by the table of that name.

    Raises:
        ValueError: a table has no place, more than one, or a place no table.
    """
    places = re.findall(r"\{\{(\w+)\}\}", template)
    if sorted(places) != sorted(tables):
        raise ValueError(f"the template has places for {', '.join(sorted(places))}; the tables are {sorted(tables)}")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: tables[place[1]], template)


def readme() -> str:
    """The README as the results files make it."""
    return filled(README.read_text(encoding="utf-8"), {"figures": figures_section(results_in(RESULTS))})


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes docs/results.md and the README's figures."""
    argparse.ArgumentParser(prog="python -m experiments.documentation.results", description=main.__doc__).parse_args(
        arguments
    )
    for path, text in ((PAGE, page()), (README, readme())):
        with written_whole(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print(f"written: {path.relative_to(ROOT)}")


if __name__ == "__main__":
    run_command(main)
