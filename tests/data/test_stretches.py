"""What a recording's scenes are made of: stretches without what the model does not know."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.build import build
from data.pipeline.filters import overtakings, touchings
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.scenes.scene import Track
from tests.support.built_scenes import scenes_of, steady_traffic
from tests.support.recordings import Mover, on_route, steady, walking, write_recording


def test_undisturbed_recording_is_one_scene(tmp_path: Path, bendplatz: Intersection) -> None:
    (scene,), dropped = scenes_of(tmp_path, bendplatz, steady_traffic(bendplatz, 40.0))
    assert (scene.id, scene.start, scene.steps, scene.split) == ("07/0", 0.0, 211, "train")
    assert len(scene.tracks) == 10
    assert set(dropped) - {"tracks: in no scene"} == {"extrapolation: inside at the start"}
    later = scene.track("07/14")
    assert later.start == 80 - 30
    assert (~later.observed).sum() == 30
    assert np.allclose(later.position, 110.0 + 1.6 * np.arange(-30, 51), atol=0.05)
    assert np.allclose(later.speed, 8.0, atol=0.05)
    assert not later.acceleration[:30].any()


def test_crossing_pedestrian_is_cut_out(tmp_path: Path, bendplatz: Intersection) -> None:
    sample = bendplatz.routes[bendplatz.route_index("NW-SE")].samples[190]
    x, y, heading = sample[[Sample.X, Sample.Y, Sample.HEADING]].tolist()
    aside = 14.0 * np.array([-np.sin(heading), np.cos(heading)])
    there, back = (np.array([x, y]) + side * aside for side in (1.0, -1.0))
    movers = [*steady_traffic(bendplatz, 80.0), walking(1, 40.0, there.tolist(), back.tolist(), 20.0)]
    scenes, dropped = scenes_of(tmp_path, bendplatz, movers)
    assert len(scenes) == 2
    assert dropped["stretches: crossing pedestrian"] >= 1
    cut = scenes[1].start - 0.2 * scenes[0].steps
    assert 4.0 < cut < 15.0
    assert dropped["seconds: crossing pedestrian"] == pytest.approx(cut)
    both = {track.id for track in scenes[0].tracks} & {track.id for track in scenes[1].tracks}
    for id in both:
        before, after = scenes[0].track(id), scenes[1].track(id)
        assert before.position[-1] < after.position[0]


def test_pedestrian_on_the_pavement_changes_nothing(tmp_path: Path, bendplatz: Intersection) -> None:
    samples = bendplatz.routes[bendplatz.route_index("NW-SE")].samples
    x, y, heading, width = samples[140, [Sample.X, Sample.Y, Sample.HEADING, Sample.WIDTH]]
    aside = np.array([np.sin(heading), -np.cos(heading)]) * (0.5 * width + 0.5)
    along = np.array([np.cos(heading), np.sin(heading)])
    start = np.array([x, y]) + aside
    movers = [*steady_traffic(bendplatz, 40.0), walking(1, 5.0, start.tolist(), (start - 20 * along).tolist(), 20.0)]
    scenes, dropped = scenes_of(tmp_path, bendplatz, movers)
    assert len(scenes) == 1
    assert "stretches: crossing pedestrian" not in dropped


def test_bicycle_without_a_route_is_cut_out(tmp_path: Path, bendplatz: Intersection) -> None:
    centre = np.linspace([20.0, -30.0], [90.0, -30.0], 376)
    scenes, dropped = scenes_of(
        tmp_path, bendplatz, [*steady_traffic(bendplatz, 80.0), Mover(1, "bicycle", 1000, centre, 0.0, 0.0)]
    )
    assert dropped["stretches: bicycle without a route"] >= 1
    assert dropped["tracks: fits no route"] == 1
    assert len(scenes) == 2


def test_overtaking_is_cut_out(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        *steady_traffic(bendplatz, 80.0),
        on_route(bendplatz, "NW-SE", 1, 36.0, steady(112.0, 3.0), 20.0, "bicycle", aside=-1.0),
    ]
    scenes, dropped = scenes_of(tmp_path, bendplatz, movers)
    assert dropped["stretches: overtaking"] >= 1
    assert len(scenes) >= 2
    for scene in scenes:
        for interval in overtakings(scene.tracks, bendplatz):
            pytest.fail(f"{interval} is still in scene {scene.id}")


def test_overlapping_bodies_are_cut_out(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        *steady_traffic(bendplatz, 80.0),
        on_route(bendplatz, "NW-SE", 1, 40.0, steady(107.0, 8.0), 9.0, aside=-1.0),
    ]
    scenes, dropped = scenes_of(tmp_path, bendplatz, movers)
    assert dropped["stretches: overlapping vehicles"] == 1
    assert "stretches: overtaking" not in dropped
    assert len(scenes) == 2


def test_recording_shorter_than_a_scene_is_counted(tmp_path: Path, bendplatz: Intersection) -> None:
    scenes, dropped = scenes_of(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 11.8)])
    assert not scenes
    assert dropped["stretches: shorter than 12 s"] == 1
    assert dropped["tracks: in no scene"] == 1


def test_scene_of_exactly_twelve_seconds_is_kept(tmp_path: Path, bendplatz: Intersection) -> None:
    scenes, _ = scenes_of(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 12.0)])
    assert [scene.steps for scene in scenes] == [61]
    assert scenes[0].duration == pytest.approx(12.0)


def test_recording_of_a_few_frames_gives_no_scene(tmp_path: Path, bendplatz: Intersection) -> None:
    mover = on_route(bendplatz, "NW-SE", 1, 0.04, steady(100.0, 8.0), 0.08)
    scenes, dropped = scenes_of(tmp_path, bendplatz, [mover])
    assert not scenes
    assert dropped["tracks: shorter than 1 s"] == 1


def test_every_moment_of_the_scenes_is_sound_traffic(tmp_path: Path, bendplatz: Intersection) -> None:
    pair = (bendplatz.route_index("SW-NE"), bendplatz.route_index("NW-SE"))
    (conflict,) = (one for one in bendplatz.conflicts if (one.yielder, one.prioritized) == pair)
    where, there = float(np.mean(conflict.on_yielder)), float(np.mean(conflict.on_prioritized))
    meeting = 24.0 + (there - 110.0) / 8.0
    movers = [
        *steady_traffic(bendplatz, 80.0),
        on_route(bendplatz, "NW-SE", 1, 36.0, steady(112.0, 3.0), 20.0, "bicycle", aside=-1.0),
        on_route(bendplatz, "SW-NE", 2, 20.0, steady(where - 7.0 * (meeting - 20.0), 7.0), 14.0),
    ]
    write_recording(tmp_path, "07", movers)
    scenes = build(tmp_path, bendplatz, progress=False)
    assert "seconds: touching vehicles" in scenes.dropped
    for scene in scenes:
        for step in range(scene.steps):
            assert scenes.at(scene, 0.2 * step).overlaps == ()


def standing(bendplatz: Intersection, id: str, position: float, speed: float) -> Track:
    two = np.zeros(2, np.float32)
    route = bendplatz.route_index("NW-SE")
    return Track(id, "car", route, 4.5, 1.8, 5, two + np.float32(position), two + np.float32(speed), two, two == 0.0)


def test_track_that_the_core_refuses_is_named_with_its_recording(bendplatz: Intersection) -> None:
    tracks = [standing(bendplatz, "07/3", 50.0, 5.0), standing(bendplatz, "07/12", 80.0, 150.0)]
    with pytest.raises(ValueError, match=r"recording 07, 1\.0 s: vehicle 07/12: speed"):
        touchings(tracks, bendplatz)


def test_moment_with_more_vehicles_than_the_core_takes_is_named(bendplatz: Intersection) -> None:
    tracks = [standing(bendplatz, f"07/{number}", 2.0 * number, 0.0) for number in range(65)]
    with pytest.raises(ValueError, match=r"recording 07, 1\.0 s: 65 vehicles"):
        touchings(tracks, bendplatz)
