"""Headline figures are kept under a name, with their commit, and stand beside those of today."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from experiments.documentation.results import RESULTS as SHIPPED
from experiments.report.baseline import BASELINES, baselines_in, baselines_table, keep, main
from experiments.report.headlines import headlines
from experiments.results_files import results_in

COMMIT = "0123456789abcdef"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for path in SHIPPED.glob("*.json"):
        if path.name != BASELINES:
            shutil.copyfile(path, tmp_path / path.name)
    return tmp_path


def test_kept_figures_stay_while_todays_change(folder: Path) -> None:
    keep("before", folder, COMMIT)
    results = results_in(folder)
    kept = baselines_in(folder)
    assert kept["before"]["figures"] == {row.what: row.ours for row in headlines(results)}
    results["closed_loop"]["drivers"]["ppo"]["gap"]["reward"] = 9.99
    table = baselines_table(kept, results)
    row = next(line for line in table.splitlines() if "mean reward" in line)
    was = kept["before"]["figures"]["PPO, 2000 s: mean reward"]
    assert row == f"| PPO, 2000 s: mean reward | {was} | 9.99 |"
    assert "before (0123456)" in table.splitlines()[0]


def test_no_two_headlines_have_one_name() -> None:
    names = [row.what for row in headlines(results_in(SHIPPED))]
    assert len(set(names)) == len(names)


def test_baseline_is_never_overwritten(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep("before", folder, COMMIT)
    with pytest.raises(ValueError, match='holds a baseline "before" already'):
        keep("before", folder, "another")
    assert main(["before", "--results", str(folder)]) == 1
    assert "error:" in capsys.readouterr().err
    assert json.loads((folder / BASELINES).read_text())["before"]["commit"] == COMMIT


def test_command_keeps_the_commit_that_is_checked_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def said(*_: object, **__: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess([], 0, f"{COMMIT}\n", "")

    monkeypatch.setattr(subprocess, "run", said)
    assert main(["now", "--results", str(folder)]) == 0
    assert baselines_in(folder)["now"]["commit"] == COMMIT
    assert 'kept as "now"' in capsys.readouterr().out
