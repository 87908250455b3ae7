"""The demo runs from recordings to pictures and tables, on both maps, and says what is wrong where it cannot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.demo import FILES, busiest, main
from intersection_env import Intersection, Scene, Scenes
from intersection_env.evaluation.moments import moments_of
from intersection_env.maps.intersection import MAPS
from intersection_env.plots import animation
from intersection_env.policies.named import POLICIES, RULES
from intersection_env.scenes.scene import Track
from tests.support.recordings import MOVERS, on_route, steady, write_recording


@pytest.fixture(params=MOVERS)
def recorded(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, Path]:
    """A map source for location 1, and a folder of three recordings there: one for each split."""
    source = json.loads((MAPS / f"{request.param}.json").read_text(encoding="utf-8"))
    path = tmp_path / f"{request.param}.json"
    path.write_text(json.dumps({**source, "locations": [1]}), encoding="utf-8")
    intersection = Intersection.load(path)
    movers = [
        on_route(intersection, route, track, 0.0, steady(position, speed), 13.0)
        for track, route, position, speed in MOVERS[request.param]
    ]
    for id, own in (("00", movers[:1]), ("01", movers), ("02", movers[:1])):
        write_recording(tmp_path / "recordings", id, own)
    return path, tmp_path / "recordings"


def test_demo_ranks_draws_and_evaluates(
    recorded: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(animation, "DOTS_PER_INCH", 30)  # small and few, hence fast
    monkeypatch.setattr(animation, "FRAMES_PER_STEP", 1)
    path, recordings = recorded
    out = tmp_path / "out" / "demo"
    assert main(["--recordings", str(recordings), "--map", str(path), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert sorted(one.name for one in out.iterdir()) == sorted(FILES)
    for name in FILES:
        assert f"written: {out / name}" in printed
    assert "no intervention" in printed
    assert "2 open conflicts among recorded vehicles" in printed
    assert "3 feasible orders predicted" in printed
    table = pd.read_csv(out / "errors.csv")
    populations = table.groupby("model")["population"].agg(set)
    assert all({"recorded", "until_last_seen", "last_seen"} <= found for found in populations)
    assert set(table["model"]) == {*RULES, *(path.stem for path in POLICIES.glob("*.policy"))}
    # all drive steadily: constant velocity is right, the intelligent driver is not
    steadily = table[table["model"] == "constant_velocity"]
    assert steadily["rmse"].max() < 0.5 < table["rmse"].max()
    scenes = Scenes.load(out / "scenes.npz", Intersection.load(path))
    assert {scene.recording for scene in scenes} == {"01"}


def test_demo_without_recordings_names_the_folder_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["--recordings", str(tmp_path / "nowhere"), "--out", str(out)]) == 1
    assert "nowhere" in capsys.readouterr().err
    assert not out.exists()


def test_demo_without_a_development_recording_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    intersection = Intersection.load("bendplatz")
    write_recording(tmp_path, "00", [on_route(intersection, "SE-NW", 1, 0.0, steady(60.0, 8.0), 14.0)])
    assert main(["--recordings", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "none of its 1 recordings is for development" in capsys.readouterr().err


def test_map_that_does_not_ship_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--map", "nowhere"]) == 1
    assert 'no map "nowhere" ships' in capsys.readouterr().err


def test_busiest_moment_counts_only_conflicts_between_recorded_vehicles() -> None:
    intersection = Intersection.load("bendplatz")
    steps = np.arange(60, dtype=np.float32)

    def track(id: str, route: str, begin: float, extrapolated: int) -> Track:
        position, speed = begin + np.float32(0.2) * steps, np.ones(60, np.float32)
        index, rest = intersection.route_index(route), np.zeros(60, np.float32)
        return Track(id, "car", index, 4.5, 1.8, 0, position, speed, rest, steps >= extrapolated)

    tracks = (track("00/1", "NW-NE", 130.0, 0), track("00/2", "SE-NW", 130.0, 4), track("00/3", "SE-NW", 120.0, 7))
    scene = Scene("00/0", "00", "development", 0.0, 60, tracks)
    moments, _ = moments_of(Scenes(intersection, (scene,), {}, {}))
    assert [len(moment.traffic.conflicts) for moment in moments[:3]] == [2, 2, 2]
    assert busiest(moments[:1]).step == 0
    assert busiest(moments[:2]).step == 5
    assert busiest([moments[1], moments[0]]).step == 5


def test_no_moment_is_busiest_where_none_lasts_ten_seconds() -> None:
    with pytest.raises(ValueError, match="10 s"):
        busiest([])
