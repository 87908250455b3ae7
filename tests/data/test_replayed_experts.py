"""No recorded driver is punished for what it was recorded to do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.build import build
from data.pipeline.filters import touchings
from imitation.tracks import each_track, replays
from intersection_env.constants import ACCELERATION
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from tests.support.built_scenes import steady_traffic
from tests.support.paths import RECORDINGS
from tests.support.recordings import on_route, steady, write_recording

COLLISION = -1000.0  # less is a collision: no other penalty of one step comes near
SOME = ["04", "08", "15"]


def punished(scenes: Scenes, gap: str) -> list[str]:
    """The ids of those whose replay, driven as recorded, ends in a collision of their own fault."""
    worlds = replays(scenes, None, gap)
    ids = [track.id for scene in scenes for track in scene.tracks]
    found: list[str] = []
    for drives in each_track(worlds):
        assert drives.any()
        while drives.any():
            np.clip(worlds.expert_acceleration / ACCELERATION, -1.0, 1.0, out=worlds.action)
            worlds.step()
            found += [ids[worlds.track[world]] for world in np.flatnonzero(drives & (worlds.reward < COLLISION))]
            drives &= ~(worlds.terminated | worlds.truncated)
    return found


@pytest.mark.parametrize("gap", ["recording", "critical_gap"])
def test_recorded_drivers_replay_themselves_unpunished(bendplatz: Intersection, gap: str) -> None:
    scenes = build(RECORDINGS, bendplatz, SOME, progress=False)
    assert sum(len(scene.tracks) for scene in scenes) > 300
    assert not punished(scenes, gap)


def closing_in(folder: Path, bendplatz: Intersection) -> Scenes:
    """A driver comes up to a bicycle too fast to stop behind it; whether it overtakes is not seen any more."""
    movers = [
        *steady_traffic(bendplatz, 32.0),
        on_route(bendplatz, "NW-SE", 1, 40.0, steady(150.0, 4.5), 12.0, "bicycle"),
        on_route(bendplatz, "NW-SE", 2, 44.0, steady(110.0, 12.0), 6.0),
    ]
    write_recording(folder, "07", movers)
    return build(folder, bendplatz, progress=False)


def test_who_comes_too_close_to_brake_is_cut_out(tmp_path: Path, bendplatz: Intersection) -> None:
    scenes = closing_in(tmp_path, bendplatz)
    assert scenes.dropped["stretches: vehicles too close to brake"] == 1
    assert {track.id for scene in scenes for track in scene.tracks} >= {"07/1", "07/2"}
    assert not punished(scenes, "recording")
    for scene in scenes:
        assert not touchings(scene.tracks, bendplatz)


def test_without_the_cut_it_would_be_punished(
    tmp_path: Path, bendplatz: Intersection, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("data.pipeline.scenes_of.touchings", lambda *_: [])
    assert punished(closing_in(tmp_path, bendplatz), "recording") == ["07/2"]
