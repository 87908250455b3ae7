"""The command from a folder of recordings to a scenes file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from data.build import build, main
from intersection_env.maps.intersection import MAPS, Intersection
from intersection_env.scenes.scenes import Scenes
from tests.support.built_scenes import steady_traffic
from tests.support.own_place import own_map, own_recordings
from tests.support.recordings import on_route, steady, write_recording


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
    for word in ("recordings are of location 4", '"bendplatz": no recording in', "location 1, 901", "--map PATH"):
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


def test_recordings_of_two_places_make_a_file_each(
    tmp_path: Path, bendplatz: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = own_recordings(folder_of(tmp_path / "in", bendplatz, 3, 901), own_map(tmp_path), "20", "21", "22")
    assert main([str(folder), "--out", str(tmp_path / "shipped")]) == 0
    assert [path.name for path in (tmp_path / "shipped").iterdir()] == ["bendplatz.npz"], "where recordings lie"
    both = ["--map", "bendplatz", str(tmp_path / "mine.json")]
    assert main([str(folder), *both, "--out", str(tmp_path / "both")]) == 0
    assert sorted(path.name for path in (tmp_path / "both").iterdir()) == ["bendplatz.npz", "mine.npz"]
    assert (tmp_path / "both" / "bendplatz.npz").read_bytes() == (tmp_path / "shipped" / "bendplatz.npz").read_bytes()
    splits = {scene.recording: scene.split for scene in Scenes.load(tmp_path / "both" / "mine.npz", both[2])}
    assert splits == {"20": "train", "21": "development", "22": "validation"}
    assert main([str(folder), *both, "--recordings", "21", "--out", str(tmp_path / "some")]) == 0
    assert [path.name for path in (tmp_path / "some").iterdir()] == ["mine.npz"], "where the recording lies"
    assert main([str(folder), *both, "--recordings", "99", "--out", str(tmp_path / "none")]) == 1
    assert "no recording 99 here" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    assert main([str(folder), *both, "--out", str(tmp_path / "one.npz")]) == 1
    assert "recordings lie on several maps (bendplatz, mine); give a --map" in capsys.readouterr().err
    assert main([str(folder), "--map", "t_junction", "--out", str(tmp_path / "one.npz")]) == 1
    assert 'map "t_junction": no recording in' in capsys.readouterr().err
