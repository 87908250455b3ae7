"""The run folder: what it refuses, and what it reads of a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from agents.gap.train import GapSettings
from agents.networks.gap import GapNetwork
from agents.ppo import PpoSettings
from agents.training.folder import METRICS, RunFolder, decisive, last_row
from tests.support.trainings import cut_short


def test_run_with_other_settings_or_data_does_not_go_on(tmp_path: Path) -> None:
    RunFolder.begin(tmp_path, {"epochs": 5}, "one", resume=False)
    with pytest.raises(ValueError, match="holds a run already"):
        RunFolder.begin(tmp_path, {"epochs": 5}, "one", resume=False)
    with pytest.raises(ValueError, match='had "epochs" = 5, not 6'):
        RunFolder.begin(tmp_path, {"epochs": 6}, "one", resume=True)
    with pytest.raises(ValueError, match="= 'one', not 'two'"):
        RunFolder.begin(tmp_path, {"epochs": 5}, "two", resume=True)


def test_checkpoint_cut_short_is_named(tmp_path: Path) -> None:
    folder = RunFolder.begin(tmp_path, {}, "data", resume=False)
    folder.save({"epoch": 1, "network": GapNetwork().state_dict()})
    cut_short(tmp_path)
    with pytest.raises(ValueError, match=r"checkpoint\.pt is damaged"):
        folder.load()


def test_metrics_after_the_checkpoint_are_dropped(tmp_path: Path) -> None:
    folder = RunFolder.begin(tmp_path, {}, "data", resume=False)
    for epoch in (1, 2, 3):
        folder.append({"epoch": epoch})
    folder.save({"epoch": 2})
    with (tmp_path / METRICS).open("a") as file:
        file.write('{"epo')
    assert last_row(tmp_path / METRICS) == {"epoch": 3}, "the last line is cut short"
    assert folder.load() == {"epoch": 2}
    assert (tmp_path / METRICS).read_text() == '{"epoch": 1}\n{"epoch": 2}\n'
    assert last_row(tmp_path / METRICS) == {"epoch": 2}
    assert last_row(tmp_path / "none") == {}


def test_where_a_run_lies_and_how_it_is_done_does_not_decide_its_result() -> None:
    here, there = (
        PpoSettings(run=Path(name), threads=count, workers=count, seeds=(count,), tensorboard=bool(count))
        for count, name in enumerate(("here", "there"))
    )
    assert decisive(here) == decisive(there)
    assert decisive(here)["gaps"] == ["gap", "critical_gap"]
    assert decisive(here) != decisive(PpoSettings(seed=1))
    assert decisive(GapSettings(scenes=(Path("a"),), map=("b",), resume=True)) == decisive(GapSettings())
