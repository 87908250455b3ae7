"""What is said about the recordings that a measurement is of."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.measure import crossing_order
from experiments.measure.recorded import places_of
from tests.support.scenes import small_scenes


def test_an_empty_split_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "small.npz"
    small_scenes("train").save(path)
    options = crossing_order.Options(scenes=(path,), split="validation", policies=("idm",), out=tmp_path)
    assert crossing_order.main(options) == 1
    assert f'error: {path}: no scene of split "validation"; there are scenes of train' in capsys.readouterr().err


def test_one_recording_is_said_to_give_intervals_without_a_width(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "small.npz"
    small_scenes("development", each=1).save(path)
    places_of((path,), (), "development")
    assert "there is one recording (12); intervals are over recordings, and have no width" in capsys.readouterr().err
    places_of((Path("bendplatz"),), (), "development")
    assert capsys.readouterr().err == ""
