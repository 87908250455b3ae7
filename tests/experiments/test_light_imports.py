"""Whoever shows results loads none of what measured them."""

from __future__ import annotations

import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

from experiments import report, show

SHOWS = [
    "experiments.results_files",
    "experiments.documentation.results",
    *(one.name for room in (show, report) for one in pkgutil.iter_modules(room.__path__, f"{room.__name__}.")),
]
LEARNS = ("torch", "torchrl", "tensordict", "sklearn")
TEXTS = """
from experiments.documentation.results import RESULTS, page, readme
from experiments.report.report import report
from experiments.results_files import results_in

results = results_in(RESULTS)
assert page() and readme() and report(results, **results["reproduced"])
"""
FIGURES = """
import shutil
from pathlib import Path

from experiments.documentation.results import RESULTS
from experiments.report.report import write_report

for file in RESULTS.glob("*.json"):
    shutil.copy(file, "{folder}")
write_report(Path("{folder}"))
"""


def loaded(code: str, wanted: tuple[str, ...]) -> list[str]:
    """Which of these modules a process has loaded once it has run the code."""
    code += f"\nimport sys\nprint('loaded:', *(name for name in {wanted} if name in sys.modules))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return said.splitlines()[-1].split()[1:]


@pytest.mark.parametrize("code", ["\n".join(f"import {name}" for name in SHOWS), TEXTS], ids=["imports", "texts"])
def test_tables_and_pages_load_neither_torch_nor_scikit_learn_nor_matplotlib(code: str) -> None:
    assert loaded(code, (*LEARNS, "matplotlib")) == []


def test_figures_of_a_report_load_neither_torch_nor_scikit_learn(tmp_path: Path) -> None:
    assert loaded(FIGURES.format(folder=tmp_path), (*LEARNS, "matplotlib")) == ["matplotlib"]
    assert (tmp_path / "figures" / "runtime.svg").exists()
