"""Traffic is simulated on places so many times as large, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.build import build
from data.sumo import generate
from data.sumo.larger import larger
from data.sumo.places import BENDPLATZ, CROSSROADS, PLACES, Place
from intersection_env.maps.intersection import Intersection, Sample


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.map)
@pytest.mark.parametrize("times", [1.5, 2.2])
def test_ways_are_so_many_times_as_long_in_lanes_as_wide(tmp_path: Path, place: Place, times: float) -> None:
    found = larger(place, times, tmp_path)
    usual, large = Intersection.load(place.map), Intersection.load(found.source)
    assert large.locations == (found.location,)
    for one, other in zip(usual.routes, large.routes, strict=True):
        assert other.id == one.id
        assert other.length == pytest.approx(times * one.length, rel=0.02)
        assert other.samples[:, Sample.WIDTH].max() == pytest.approx(one.samples[:, Sample.WIDTH].max(), rel=0.02)
    assert len(large.conflicts) > 0


def test_cameras_see_further(tmp_path: Path) -> None:
    assert larger(BENDPLATZ, 2.0, tmp_path).view == {right: far + 10.0 for right, far in BENDPLATZ.view.items()}


def test_turns_are_gentler(tmp_path: Path) -> None:
    usual, large = (Intersection.load(one.source) for one in (CROSSROADS, larger(CROSSROADS, 2.0, tmp_path)))
    for id in ("W-S", "N-W", "W-N"):
        sharpest = [
            float(np.abs(one.routes[one.route_index(id)].samples[:, Sample.HEADINGS + 2]).max())
            for one in (usual, large)
        ]  # by how much a route turns over 3 m
        assert sharpest[1] == pytest.approx(0.5 * sharpest[0], rel=0.15)


def test_recordings_lie_on_the_written_map_and_make_scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(generate, "DURATION", 100.0)
    generate.generate(30, tmp_path, larger=1.5)
    scenes = build(tmp_path, Intersection.load(tmp_path / "crossroads_150.json"), progress=False)
    assert sum(scene.steps for scene in scenes) > 0
    assert sum(len(scene.tracks) for scene in scenes) > 10
    assert not scenes.dropped.get("tracks: fits no route")
