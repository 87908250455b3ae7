"""Seeds side by side give the bytes of each alone; what cannot be had is said."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from agents.ppo import main
from agents.training.folder import CHECKPOINT, METRICS, last_row
from tests.support.scenes import small_scenes
from tests.support.trainings import TINY_SHARED as TINY
from tests.support.trainings import outcome, train_alone, trainer_of

PATIENCE = 60.0  # [s]


@pytest.mark.ray
@pytest.mark.usefixtures("ray_with_two_cores")
def test_seeds_side_by_side_do_what_each_does_alone_and_one_may_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "seed_7").mkdir(parents=True)
    (tmp_path / "runs" / "seed_7" / "config.json").write_text("{}")
    assert main(replace(TINY, run=Path("runs"), seeds=(7, 1, 2))) == 1
    printed = capsys.readouterr()
    assert "seed 7: error:" in printed.err
    assert "holds a run already" in printed.err
    for seed in (1, 2):
        assert f"seed {seed}: bendplatz, 2000 s" in printed.out
        assert (tmp_path / "runs" / f"seed_{seed}" / "ppo.policy").exists()
        train_alone(replace(TINY, run=tmp_path / f"alone_{seed}", seed=seed))
        assert outcome(tmp_path / "runs" / f"seed_{seed}") == outcome(tmp_path / f"alone_{seed}")


@pytest.mark.ray
@pytest.mark.usefixtures("ray_with_two_cores")
def test_seeds_of_a_trainer_without_threads_or_workers_are_those_of_each_alone(tmp_path: Path) -> None:
    small_scenes("train", "development", each=1).save(tmp_path / "scenes.npz")
    trainer = trainer_of("rollout_gradient", tmp_path / "scenes.npz")
    assert trainer.main(replace(trainer.settings, run=tmp_path / "runs", seeds=(1, 2))) == 0
    for seed in (1, 2):
        assert trainer.outcome(tmp_path / "runs" / f"seed_{seed}") == trainer.train(tmp_path / str(seed), seed=seed)


@pytest.mark.ray
@pytest.mark.usefixtures("ray_with_two_cores")
def test_sigterm_ends_all_seeds_at_a_whole_epoch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [tmp_path / f"seed_{seed}" for seed in (1, 2)]

    def tell() -> None:
        end = time.monotonic() + PATIENCE
        while not all((run / METRICS).exists() for run in runs) and time.monotonic() < end:
            time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=tell)
    thread.start()
    assert main(replace(TINY, run=tmp_path, seeds=(1, 2), epochs=100_000)) == 143
    thread.join()
    printed = capsys.readouterr()
    for run in runs:
        assert f"--resume goes on from {run}" in printed.err
        assert torch.load(run / CHECKPOINT)["epoch"] == last_row(run / METRICS)["epoch"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"workers": 2}, "workers needs Ray, which is not installed: pip install -e '.[ray]'"),
        ({"seeds": (1, 2)}, "seeds needs Ray, which is not installed: pip install -e '.[ray]'"),
        ({"seeds": (1, 2), "workers": 2}, "--seeds and --workers do not go together"),
        ({"workers": 3}, "2 worlds of each of 2 environments can be divided"),
    ],
)
def test_what_cannot_be_had_without_ray_is_said(
    asked: dict[str, Any],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)  # as if it were not installed
    assert main(replace(TINY, run=tmp_path, **asked)) == 1
    assert message in capsys.readouterr().err
