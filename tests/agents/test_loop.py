"""The loop of epochs: which are left, when checkpoints are due, what a checkpoint holds, and Ctrl-C."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from agents.training.folder import METRICS, RunFolder
from agents.training.interrupt import Interrupted
from agents.training.loop import PROJECTED_FROM, Epochs, geometric, linear


def parts() -> dict[str, Any]:
    """One of each kind."""
    return {
        "network": nn.Linear(2, 2),
        "generator": torch.Generator().manual_seed(3),
        "best": {"error": 1.0},
    }


def run(folder: RunFolder | None, count: int = 7, stop_in: int = 0, **held: Any) -> list[int]:
    """Goes through the epochs that are left; which."""
    seen = []
    with Epochs("a test", count, folder, checkpoint_every=3, progress=False) as epochs:
        epochs.resume(**held)
        for epoch in epochs:
            seen.append(epoch)
            if epoch == stop_in:
                signal.raise_signal(signal.SIGINT)
            epochs.end({"share": epochs.share} | ({"closer": 1} if epochs.is_due else {}))
    return seen


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.begin(tmp_path / "run", {}, "data", resume=False)


def test_every_third_epoch_and_the_last_have_checkpoints_and_the_share_goes_from_0_to_1(folder: RunFolder) -> None:
    assert run(folder) == [1, 2, 3, 4, 5, 6, 7]
    rows = (folder.path / METRICS).read_text().splitlines()
    assert [number for number, row in enumerate(rows, 1) if "closer" in row] == [3, 6, 7]
    assert rows[0] == '{"epoch": 1, "share": 0.0}'
    assert rows[-1] == '{"epoch": 7, "share": 1.0, "closer": 1}'
    assert run(folder) == [], "all were done"


def test_epochs_without_a_folder_start_anew() -> None:
    assert run(None, 2) == run(None, 2) == [1, 2]


def test_parts_are_set_back_to_the_checkpoint_they_were_held_in(folder: RunFolder) -> None:
    held = parts()
    drawn = torch.rand(3, generator=torch.Generator().manual_seed(3))
    run(folder, **held)
    with torch.no_grad():
        kept = held["network"].weight.clone()
        held["network"].weight.zero_()
    held["best"] |= {"error": 0.5, "epoch": 4}
    torch.rand(5, generator=held["generator"])
    run(folder, **held)
    assert (held["network"].weight == kept).all()
    assert held["best"] == {"error": 1.0}
    assert (torch.rand(3, generator=held["generator"]) == drawn).all()


def test_ctrl_c_ends_after_the_epoch_under_way_with_a_checkpoint(folder: RunFolder) -> None:
    with pytest.raises(Interrupted):
        run(folder, stop_in=4)
    state = folder.load()
    assert state is not None
    assert state["epoch"] == 4
    assert run(folder) == [5, 6, 7]


def test_ctrl_c_in_the_last_epoch_changes_nothing(folder: RunFolder) -> None:
    assert run(folder, stop_in=7)[-1] == 7


def test_the_time_that_is_left_is_projected_once(capsys: pytest.CaptureFixture[str]) -> None:
    with Epochs("a test", PROJECTED_FROM + 2, None, checkpoint_every=100) as epochs:
        for _ in epochs:
            epochs.end({})
    assert capsys.readouterr().out.count(f"{PROJECTED_FROM + 2} epochs at this rate: 0.00 h") == 1


def test_what_falls_falls_by_equal_differences_or_ratios() -> None:
    assert [linear(1e-3, 2e-4, share) for share in (0.0, 0.5, 1.0)] == pytest.approx([1e-3, 6e-4, 2e-4])
    assert [geometric(0.4, 0.1, share) for share in (0.0, 0.5, 1.0)] == pytest.approx([0.4, 0.2, 0.1])
