"""From a recording to scenes: what is kept lies where it was driven, and what is dropped is counted."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data.build import build, main
from data.formats.ind import read_recording
from data.pipeline.filters import overtakings, touchings
from data.pipeline.projection import Projection, project
from data.pipeline.scenes_of import build_scenes
from data.pipeline.shared_lanes import overlap_length, pair_gap
from data.pipeline.split import split_of
from intersection_env.maps.intersection import MAPS, Intersection
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes
from tests.support.recordings import Floats, Mover, on_route, steady, walking, write_recording

ROUTES = ["NW-NE", "NW-SW", "NW-SE", "NE-NW", "NE-SW", "NE-SE", "SW-NW", "SW-NE", "SW-SE", "SE-NW", "SE-NE", "SE-SW"]


@pytest.fixture(scope="module")
def bendplatz() -> Intersection:
    return Intersection.load("bendplatz")


def projected(folder: Path, intersection: Intersection, movers: list[Mover]) -> Projection:
    write_recording(folder, "07", movers)
    return project(read_recording(folder, "07").resampled(0.2), intersection)


def scenes_of(folder: Path, intersection: Intersection, movers: list[Mover]) -> tuple[list[Scene], dict[str, float]]:
    write_recording(folder, "07", movers)
    return build_scenes(read_recording(folder, "07"), "train", intersection)


def turning_back(time: Floats) -> Floats:
    return np.asarray(60.0 + 4.0 * time - 0.8 * np.maximum(time - 3.0, 0.0) ** 2)


def braking(position: float, speed: float, deceleration: float) -> Callable[[Floats], Floats]:
    return lambda time: np.asarray(position + speed * time - 0.5 * deceleration * time**2)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("aside", [0.0, 0.8, -0.8])
def test_track_is_found_on_its_route_within_centimetres(
    tmp_path: Path, bendplatz: Intersection, route: str, aside: float
) -> None:
    stop_line = bendplatz.routes[bendplatz.route_index(route)].stop_line
    motion = braking(stop_line - 30.0, 9.0, 0.5)
    projection = projected(tmp_path, bendplatz, [on_route(bendplatz, route, 1, 0.0, motion, 8.0, aside=aside)])
    (track,) = projection.tracks
    assert bendplatz.routes[track.route].id == route
    assert not projection.dropped
    time = np.linspace(0.0, 0.2 * (len(track.position) - 1), len(track.position))
    assert np.abs(track.position - motion(time)).max() < (0.03 if aside == 0.0 else 0.1)
    if aside == 0.0:
        assert np.abs(track.speed - (9.0 - 0.5 * time))[1:-1].max() < 0.15
    assert track.observed.all()
    assert track.start == 0
    assert track.id == "07/1"


def test_bicycle_gets_a_nominal_size(tmp_path: Path, bendplatz: Intersection) -> None:
    bicycle = on_route(bendplatz, "SW-NE", 1, 0.0, steady(60.0, 4.0), 12.0, "bicycle", aside=-1.5)
    (track,) = projected(tmp_path, bendplatz, [bicycle]).tracks
    assert (track.length, track.width, track.road_user) == (1.8, 0.6, "bicycle")


def test_each_reason_for_dropping_a_track_is_counted(tmp_path: Path, bendplatz: Intersection) -> None:
    across = np.linspace([20.0, -30.0], [90.0, -30.0], 251)
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 12.0),
        Mover(2, "car", 0, np.tile([[30.0, 0.0]], (300, 1))),
        Mover(3, "car", 0, across),
        on_route(bendplatz, "SW-NE", 4, 0.0, turning_back, 8.0),
        on_route(bendplatz, "SW-NE", 5, 0.0, steady(50.0, 5.0), 4.0),
        on_route(bendplatz, "SW-NE", 6, 3.0, steady(50.0, 8.0), 0.6),
        walking(7, 0.0, (80.0, -90.0), (90.0, -90.0), 8.0),
        on_route(bendplatz, "SE-NW", 8, 0.0, lambda t: 200.0 - 6.0 * t, 8.0),
    ]
    projection = projected(tmp_path, bendplatz, movers)
    assert [track.id for track in projection.tracks] == ["07/1"]
    assert projection.dropped == {
        **{"parked": 1, "fits no route": 1, "drives backwards": 2, "ambiguous route": 1},
        **{"shorter than 1 s": 1, "pedestrian": 1},
    }
    assert projection.unassigned == {
        2: "fits no route",
        3: "drives backwards",
        4: "ambiguous route",
        7: "drives backwards",
    }


def test_last_position_tells_routes_of_one_lane_apart(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NE-NW", 1, 0.0, steady(50.0, 5.0), 8.8),
        on_route(bendplatz, "NE-SW", 2, 0.0, steady(40.0, 5.0), 11.4),
        on_route(bendplatz, "NE-SE", 3, 0.0, steady(30.0, 5.0), 13.4),
    ]
    tracks = projected(tmp_path, bendplatz, movers).tracks
    assert [bendplatz.routes[track.route].id for track in tracks] == ["NE-NW", "NE-SW", "NE-SE"]


def test_track_seen_in_the_exit_lane_alone_is_kept(tmp_path: Path, bendplatz: Intersection) -> None:
    projection = projected(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(180.0, 8.0), 8.0)])
    (track,) = projection.tracks
    assert bendplatz.routes[track.route].id.endswith("-SE")


def test_track_that_leaves_the_map_ends_there(tmp_path: Path, bendplatz: Intersection) -> None:
    route = bendplatz.routes[bendplatz.route_index("NW-SE")]
    mover = on_route(bendplatz, "NW-SE", 1, 0.0, steady(300.0, 10.0), 1.9)
    step = (mover.centre[-1] - mover.centre[-2])[None] * np.arange(1, 101)[:, None]
    longer = Mover(1, "car", 0, np.concatenate([mover.centre, mover.centre[-1] + step]))
    (track,) = projected(tmp_path, bendplatz, [longer]).tracks
    assert 1 <= route.length - track.position[-1] + 1 < 4
    assert len(track.position) == 11


def steady_traffic(intersection: Intersection, seconds: float, first: int = 10) -> list[Mover]:
    """A vehicle each way every 8 s, 8 m/s, seen from 110 m to 190 m."""
    return [
        on_route(intersection, route, first + 2 * k + side, 8.0 * k, steady(110.0, 8.0), 10.0)
        for k in range(int(seconds / 8.0))
        for side, route in enumerate(("NW-SE", "SE-NW"))
    ]


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
    x, y, heading = bendplatz.routes[bendplatz.route_index("NW-SE")].samples[190, :3].tolist()
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
    x, y, heading, width = samples[140, :4]
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


def test_extension_is_cut_where_it_would_overlap(tmp_path: Path, bendplatz: Intersection) -> None:
    def slow_down(time: Floats) -> Floats:
        return np.asarray(108.0 + np.where(time < 2.0, 4.0 * time, 8.0 + 9.0 * (time - 2.0)))

    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "NW-SE", 2, 20.0, steady(110.0, 9.0), 8.0),
        on_route(bendplatz, "NW-SE", 3, 21.2, slow_down, 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    assert dropped["extrapolation: cut at another vehicle"] == 1
    assert dropped["extrapolation: steps cut at another vehicle"] >= 1
    gap = pair_gap(scene.track("07/2"), scene.track("07/3"), bendplatz)
    assert gap is not None
    assert (-gap.ahead > overlap_length(scene.track("07/2"), scene.track("07/3"))).all()
    assert 0 < (~scene.track("07/3").observed).sum() < 30


def test_extension_stops_at_the_start_of_the_route(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "SW-NE", 2, 10.0, steady(40.0, 8.0), 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    track = scene.track("07/2")
    assert 0.0 <= track.position[0] < 1.6
    assert (~track.observed).sum() == 25
    assert dropped["extrapolation: reaches the start of the route"] == 1


def test_track_first_seen_in_the_junction_is_not_extended(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "SW-NE", 2, 8.0, steady(88.0, 5.0), 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    assert scene.track("07/2").observed.all()
    assert scene.track("07/2").start == 40
    assert dropped["extrapolation: first seen beyond the stop line"] == 1


def test_recording_shorter_than_a_scene_is_counted(tmp_path: Path, bendplatz: Intersection) -> None:
    scenes, dropped = scenes_of(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 11.8)])
    assert not scenes
    assert dropped["stretches: shorter than 12 s"] == 1
    assert dropped["tracks: in no scene"] == 1


def test_scene_of_exactly_twelve_seconds_is_kept(tmp_path: Path, bendplatz: Intersection) -> None:
    scenes, _ = scenes_of(tmp_path, bendplatz, [on_route(bendplatz, "NW-SE", 1, 0.0, steady(100.0, 8.0), 12.0)])
    assert [scene.steps for scene in scenes] == [61]
    assert scenes[0].duration == pytest.approx(12.0)


def folder_of(folder: Path, intersection: Intersection, count: int, location: int = 1) -> Path:
    for number in range(count):
        write_recording(folder, f"{number:02d}", steady_traffic(intersection, 24.0), location, suffix=".csv.xz")
    return folder


def test_command_writes_scenes_and_prints_what_was_dropped(
    tmp_path: Path, bendplatz: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of(tmp_path / "in", bendplatz, 3, 901)
    out = tmp_path / "deep" / "scenes.npz"
    assert main([str(tmp_path / "in"), "--map", "bendplatz", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "extrapolation: inside at the start" in printed
    assert str(out) in printed
    scenes = Scenes.load(out)
    assert [(scene.id, scene.split) for scene in scenes] == [
        *(("00/0", "train"), ("01/0", "development"), ("02/0", "validation"))
    ]
    assert scenes.dropped["extrapolation: inside at the start"] == 6
    assert [one["id"] for one in scenes.provenance["recordings"]] == ["00", "01", "02"]
    assert [path.name for path in out.parent.iterdir()] == ["scenes.npz"]


def test_same_recordings_give_the_same_bytes(tmp_path: Path, bendplatz: Intersection) -> None:
    folder_of(tmp_path, bendplatz, 2)
    for name in ("first", "second"):
        build(tmp_path, bendplatz, progress=False).save(tmp_path / f"{name}.npz")
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_recording_of_another_location_is_refused(
    tmp_path: Path, bendplatz: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of(tmp_path, bendplatz, 1, location=4)
    assert main([str(tmp_path), "--out", str(tmp_path / "scenes.npz")]) == 1
    message = capsys.readouterr().err
    for word in ("recording 00 is of location 4", '"bendplatz" is made for location 1, 901', "--map PATH"):
        assert word in message
    assert not (tmp_path / "scenes.npz").exists()


def test_recording_of_another_place_is_read_with_a_map_of_that_place(tmp_path: Path) -> None:
    source = json.loads((MAPS / "t_junction.json").read_text())
    path = tmp_path / "corner.json"
    path.write_text(json.dumps({**source, "name": "corner", "locations": [77]}))
    corner = Intersection.load(path)
    stop_line = corner.routes[corner.route_index("S-W")].stop_line
    movers = [
        on_route(corner, "S-W", 1, 0.0, steady(stop_line - 40.0, 5.0), 14.0),
        on_route(corner, "W-E", 2, 8.0, steady(120.0, 9.0), 7.0),
    ]
    write_recording(tmp_path, "40", movers, location=77)
    out = tmp_path / "scenes.npz"
    assert main([str(tmp_path), "--map", str(path), "--out", str(out)]) == 0
    with pytest.raises(ValueError, match='its map "corner" does not ship; give it'):
        Scenes.load(out)
    (scene,) = Scenes.load(out, corner)
    assert [corner.routes[track.route].id for track in scene.tracks] == ["S-W", "W-E"]
    assert len(Scenes.load(out, corner).at(scene, 12.0)) == 2


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
            scenes.at(scene, 0.2 * step)  # Traffic refuses vehicles that overlap


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


def test_only_named_recordings_are_read(tmp_path: Path, bendplatz: Intersection) -> None:
    folder_of(tmp_path, bendplatz, 2)
    (tmp_path / "00_tracks.csv.xz").write_bytes(b"damaged")
    assert [scene.id for scene in build(tmp_path, bendplatz, ["01"], progress=False)] == ["01/0"]
    with pytest.raises(FileNotFoundError, match="no recording 05 here; there are 00, 01"):
        build(tmp_path, bendplatz, ["05"], progress=False)


def test_damaged_recording_leaves_nothing_behind(
    tmp_path: Path, bendplatz: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of(tmp_path, bendplatz, 2)
    (tmp_path / "01_tracks.csv.xz").write_bytes(b"damaged")
    out = tmp_path / "out"
    assert main([str(tmp_path), "--out", str(out / "scenes.npz")]) == 1
    assert "01_tracks.csv.xz" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("count", "expected"), [(1, "t"), (2, "tv"), (3, "tdv"), (10, "ttttttttdv"), (20, "t" * 16 + "ddvv")]
)
def test_split_without_settings_goes_by_recording(tmp_path: Path, count: int, expected: str) -> None:
    split, origin = split_of(tmp_path, [f"{number:02d}" for number in range(count)])
    assert "".join(word[0] for word in split.values()) == expected
    assert "order of recording" in origin


def test_split_of_settings_is_kept(tmp_path: Path) -> None:
    text = '{"seed": 1, "split": {"train": ["02"], "development": [0], "validation": ["01", "03"]}}'
    (tmp_path / "settings.json").write_text(text)
    split, origin = split_of(tmp_path, ["00", "01", "02"])
    assert split == {"00": "development", "01": "validation", "02": "train"}
    assert "settings.json" in origin


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "wanted an object, not list"),
        ('{"split": {"test": ["00"]}}', "must be an object with train, development, validation"),
        ('{"split": {"train": "00"}}', "must be a list of recordings"),
        ('{"split": {"train": ["00", "00"]}}', "names recording 00 twice"),
        ('{"split": {"train": ["00"], "validation": ["00"]}}', "names recording 00 twice"),
        ('{"split": {"train": ["one"]}}', "must hold recordings as"),
        ('{"split": {"train": ["01"]}}', "leaves out recording 00"),
    ],
)
def test_malformed_settings_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "settings.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        split_of(tmp_path, ["00"])


def test_recording_of_a_few_frames_gives_no_scene(tmp_path: Path, bendplatz: Intersection) -> None:
    mover = on_route(bendplatz, "NW-SE", 1, 0.04, steady(100.0, 8.0), 0.08)
    scenes, dropped = scenes_of(tmp_path, bendplatz, [mover])
    assert not scenes
    assert dropped["tracks: shorter than 1 s"] == 1
