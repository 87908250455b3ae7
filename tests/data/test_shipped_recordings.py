"""The recordings that ship, through the whole pipeline: little is lost, each reason occurs, the traffic teaches."""

from __future__ import annotations

import pytest

from data.build import build
from data.describe.statistics import Statistics, statistics
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from tests.support.paths import RECORDINGS


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return build(RECORDINGS, Intersection.load("bendplatz"), progress=False)


@pytest.fixture(scope="module")
def figures(scenes: Scenes) -> Statistics:
    return statistics(scenes)


def recorded_seconds(scenes: Scenes) -> float:
    return float(sum(one["seconds"] for one in scenes.provenance["recordings"]))


def test_split_is_twelve_three_five(scenes: Scenes) -> None:
    count = {split: len({scene.recording for scene in scenes.select(split)}) for split in ("train", "development")}
    assert count == {"train": 12, "development": 3}
    assert len({scene.recording for scene in scenes.select("validation")}) == 5


@pytest.mark.parametrize(
    "reason",
    [
        "extrapolation: cut at another vehicle",
        "extrapolation: inside at the start",
        "seconds: crossing pedestrian",
        "seconds: overtaking",
        "seconds: shorter than 12 s",
        "stretches: crossing pedestrian",
        "stretches: overtaking",
        "tracks: ambiguous route",
        "tracks: pedestrian",
    ],
)
def test_reason_for_dropping_occurs(scenes: Scenes, reason: str) -> None:
    assert scenes.dropped[reason] > 0


def test_little_is_lost(scenes: Scenes) -> None:
    vehicles = sum(one["tracks"] for one in scenes.provenance["recordings"]) - scenes.dropped["tracks: pedestrian"]
    lost = sum(count for reason, count in scenes.dropped.items() if reason.startswith("tracks: "))
    assert lost - scenes.dropped["tracks: pedestrian"] < 0.035 * vehicles
    assert sum(scene.steps for scene in scenes) * 0.2 > 0.9 * recorded_seconds(scenes)
    assert "tracks: fits no route" not in scenes.dropped  # its drivers keep to our centrelines


def test_traffic_reaches_the_bars(figures: Statistics) -> None:
    assert figures.pairs_per_hour >= 400.0
    assert figures.critical_gap is not None
    assert 4.0 <= figures.critical_gap[0] <= 7.0
    assert figures.overlapping == 0
    assert figures.smallest_gap > 0.0
    assert figures.meets_bars


def test_moments_of_the_scenes_are_sound_traffic(scenes: Scenes) -> None:
    for scene in scenes:
        for step in range(0, scene.steps, 5):
            assert scenes.at(scene, step * 0.2).overlaps == ()


def test_lost_and_kept_seconds_add_up(scenes: Scenes) -> None:
    kept = sum(scene.steps for scene in scenes) * 0.2
    lost = sum(count for reason, count in scenes.dropped.items() if reason.startswith("seconds: "))
    assert kept + lost == pytest.approx(recorded_seconds(scenes), abs=1.0)
