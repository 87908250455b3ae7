"""The scenes file: what is saved comes back exactly, and a damaged file is refused by name."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.file import joined
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes

Arrays = dict[str, NDArray[Any]]


def track(id: str, route: int, start: int, count: int, road_user: str = "car") -> Track:
    speed = np.linspace(3.0, 7.3, count).astype(np.float32)
    return Track(
        id=id,
        road_user=road_user,
        route=route,
        length=1.8 if road_user == "bicycle" else 4.25,
        width=0.6 if road_user == "bicycle" else 1.8,
        start=start,
        position=(20.0 + np.cumsum(0.2 * speed)).astype(np.float32),
        speed=speed,
        acceleration=np.gradient(speed, 0.2).astype(np.float32),
        observed=np.arange(count) >= 2,
    )


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    first = Scene("03/0", "03", "train", 0.0, 70, (track("03/1", 2, 0, 70), track("03/2", 9, 5, 40, "bicycle")))
    second = Scene("03/1", "03", "train", 20.2, 61, (track("03/2", 9, 0, 20, "bicycle"),))
    third = Scene("04/0", "04", "validation", 0.0, 61, ())
    return Scenes(
        Intersection.load("bendplatz"), (first, second, third), {"made_by": "a test"}, {"tracks: parked": 3.0}
    )


@pytest.fixture
def path(tmp_path: Path, scenes: Scenes) -> Path:
    scenes.save(tmp_path / "scenes.npz")
    return tmp_path / "scenes.npz"


def change(path: Path, edit: Callable[[Arrays], None]) -> None:
    with np.load(path) as file:
        arrays = dict(file)
    edit(arrays)
    with path.open("wb") as out:
        np.savez_compressed(out, **arrays)


def change_header(path: Path, **values: Any) -> None:
    def edit(arrays: Arrays) -> None:
        arrays["header"] = np.array(json.dumps({**json.loads(str(arrays["header"])), **values}))

    change(path, edit)


def test_round_trip_is_exact(path: Path, scenes: Scenes) -> None:
    loaded = Scenes.load(path)
    assert (loaded.provenance, loaded.dropped) == (scenes.provenance, scenes.dropped)
    assert len(loaded) == len(scenes) == 3
    for one, other in zip(loaded, scenes, strict=True):
        assert replace(one, tracks=()).__dict__ == replace(other, tracks=()).__dict__
        for left, right in zip(one.tracks, other.tracks, strict=True):
            for name in ("position", "speed", "acceleration", "observed"):
                found, wanted = getattr(left, name), getattr(right, name)
                assert found.dtype == wanted.dtype
                assert np.array_equal(found, wanted)
            for name in ("id", "road_user", "route", "start"):
                assert getattr(left, name) == getattr(right, name)
            assert left.length == float(np.float32(right.length))
            assert left.width == float(np.float32(right.width))


def test_saving_again_gives_the_same_bytes_and_leaves_one_file(path: Path) -> None:
    before = path.read_bytes()
    Scenes.load(path).save(path)
    assert path.read_bytes() == before
    assert [one.name for one in path.parent.iterdir()] == ["scenes.npz"]


def test_failed_save_leaves_the_old_file_alone(path: Path, scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    before = path.read_bytes()

    def fail(file: Any, **arrays: Any) -> None:
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", fail)
    with pytest.raises(OSError, match="disk full"):
        scenes.save(path)
    assert path.read_bytes() == before
    assert len(list(path.parent.iterdir())) == 1


def test_scenes_are_found_by_number_id_and_split(scenes: Scenes) -> None:
    assert scenes[1] is scenes["03/1"]
    assert [scene.id for scene in scenes] == ["03/0", "03/1", "04/0"]
    assert [scene.id for scene in scenes.select("validation")] == ["04/0"]
    assert len(scenes.select("development")) == 0
    assert scenes[0].track("03/2").start == 5
    with pytest.raises(ValueError, match='split is "test"; wanted one of train, development, validation'):
        scenes.select("test")
    with pytest.raises(KeyError, match="no scene"):
        scenes["09/0"]
    with pytest.raises(KeyError, match='scene 03/0 has no track "03/9"; it has 03/1, 03/2'):
        scenes[0].track("03/9")
    with pytest.raises(IndexError):
        scenes[3]


def test_traffic_holds_who_is_present_at_that_step(scenes: Scenes) -> None:
    assert scenes.at("03/0", 0.8).ids == ("03/1",)
    traffic = scenes.at(scenes[0], 1.2)
    assert traffic.ids == ("03/1", "03/2")
    assert traffic.route.tolist() == [2, 9]
    assert traffic.position.tolist() == [scenes[0].tracks[0].position[6], scenes[0].tracks[1].position[1]]
    assert traffic.speed.dtype == np.float32
    assert traffic.max_speed is not None
    assert traffic.max_speed.tolist() == [np.inf, 5.0]
    assert scenes.at(0, 44 * 0.2).ids == ("03/1", "03/2")
    assert scenes.at(0, 45 * 0.2).ids == ("03/1",)
    assert scenes.at("04/0", 12.0).ids == ()


@pytest.mark.parametrize("time", [-0.2, 0.1, 14.0, float("nan"), float("inf")])
def test_time_outside_the_scene_or_between_steps_is_refused(scenes: Scenes, time: float) -> None:
    with pytest.raises(ValueError, match=r"scene 03/0 has states every 0\.2 s from 0 to 13\.8 s"):
        scenes.at(0, time)


def test_unknown_name_is_refused() -> None:
    with pytest.raises(FileNotFoundError, match='"nowhere": no scenes file at this path'):
        Scenes.load("nowhere")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_truncated_file_is_refused(path: Path, share: float) -> None:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(ValueError, match=r"scenes\.npz: not a scenes file, or a damaged one"):
        Scenes.load(path)


def test_flipped_bytes_are_refused(path: Path) -> None:
    content = path.read_bytes()
    for place in range(200, len(content) - 200, 97):
        damaged = bytearray(content)
        damaged[place] ^= 0xFF
        path.write_bytes(bytes(damaged))
        with contextlib.suppress(ValueError):  # no other error; some bytes, as time stamps, have no meaning
            Scenes.load(path)


def test_pickled_array_is_refused(path: Path) -> None:
    change(path, lambda arrays: arrays.update(track_id=np.array([{}, {}, {}], dtype=object)))
    with pytest.raises(ValueError, match='not a scenes file, or a damaged one: array "track_id" holds Python objects'):
        Scenes.load(path)


def test_array_file_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "scenes.npy", np.zeros(3))
    with pytest.raises(ValueError, match="not a scenes file"):
        Scenes.load(tmp_path / "scenes.npy")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"format": "something"}, '"format" must be "intersection_env scenes"'),
        ({"version": 2}, '"version" is 2, this package reads 1'),
        ({"dt": 0.1}, r"dt is 0\.1 s, this package reads 0\.2 s"),
        ({"dt": "0.2"}, '"dt" is missing or of a wrong type'),
        ({"map": {"name": "bendplatz", "checksum": "00000000"}}, "checksum 00000000, but map"),
        ({"map": {"name": "elsewhere", "checksum": "00000000"}}, 'map "elsewhere" does not ship; give it'),
        ({"map": {"name": "bendplatz"}}, '"map" has no "checksum"'),
        ({"dropped": 3}, '"dropped" is missing or of a wrong type'),
    ],
)
def test_header_of_another_version_or_map_is_refused(path: Path, values: dict[str, Any], message: str) -> None:
    change_header(path, **values)
    with pytest.raises(ValueError, match=rf"scenes\.npz: .*{message}"):
        Scenes.load(path)


def put(name: str, index: int, value: Any) -> Callable[[Arrays], None]:
    def edit(arrays: Arrays) -> None:
        arrays[name][index] = value

    return edit


def set_to(name: str, make: Callable[[NDArray[Any]], Any]) -> Callable[[Arrays], None]:
    def edit(arrays: Arrays) -> None:
        arrays[name] = np.asarray(make(arrays[name]))

    return edit


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda arrays: arrays.pop("header"), "no header text"),
        (set_to("header", lambda header: "{"), "header is not JSON"),
        (lambda arrays: arrays.pop("speed"), 'array "speed" is missing'),
        (lambda arrays: arrays.update(jerk=np.zeros(1)), 'array "jerk" does not belong here'),
        (set_to("speed", lambda speed: speed.astype(np.float64)), 'array "speed" is float64'),
        (set_to("speed", lambda speed: speed[None]), r'array "speed" is float32 of shape \(1, 130\)'),
        (set_to("speed", lambda speed: speed[:-1]), 'array "speed" has 129 entries; wanted one per sample, 130'),
        (set_to("track_id", lambda id: id[:-1]), 'array "track_id" has 2 entries; wanted one per track, 3'),
        (put("scene_tracks", 1, 4), 'array "scene_tracks" must hold 4 offsets'),
        (put("track_samples", 1, 0), 'array "track_samples" must hold 4 offsets'),
        (put("track_samples", 0, 1), 'array "track_samples" must hold 4 offsets'),
        (put("position", 3, np.nan), 'array "position", entry 3: nan; wanted a finite number'),
        (put("position", 3, -1.0), r'array "position", entry 3: -1\.0'),
        (put("position", 3, 1e4), "at most the length of the route"),
        (put("speed", 7, -0.1), r'array "speed", entry 7: -0\.1'),
        (put("acceleration", 8, np.inf), 'array "acceleration", entry 8: inf'),
        (put("track_route", 1, 12), 'array "track_route", entry 1: 12; wanted 0 to 11'),
        (put("track_length", 1, -4.5), r'array "track_length", entry 1: -4\.5; wanted a positive number'),
        (put("track_width", 1, np.nan), 'array "track_width", entry 1: nan'),
        (put("track_length", 1, 50.5), r'array "track_length", entry 1: 50\.5; wanted a positive number, at most 50 m'),
        (put("track_width", 1, 10.5), r'array "track_width", entry 1: 10\.5; wanted a positive number, at most 10 m'),
        (put("track_class", 1, "tram"), 'array "track_class", entry 1: tram; wanted one of car'),
        (put("scene_split", 1, "test"), 'array "scene_split", entry 1: test; wanted one of train'),
        (put("scene_start", 1, -2.0), r'array "scene_start", entry 1: -2\.0'),
        (put("scene_steps", 0, 60), 'array "track_start", entry 0: 0; wanted a track within its scene'),
        (put("track_start", 1, -1), 'array "track_start", entry 1: -1'),
        (put("scene_id", 1, "03/0"), 'array "scene_id", entry 1: 03/0 is there twice'),
        (put("track_id", 1, "03/1"), 'array "track_id", entry 1: 0: 03/1 is there twice'),
    ],
)
def test_malformed_array_is_named(path: Path, edit: Callable[[Arrays], None], message: str) -> None:
    change(path, edit)
    with pytest.raises(ValueError, match=rf"scenes\.npz: .*{message}"):
        Scenes.load(path)


def test_scenes_that_contradict_themselves_are_not_written(tmp_path: Path, scenes: Scenes) -> None:
    wrong = replace(scenes, scenes=(scenes[0], scenes[0]))
    with pytest.raises(ValueError, match="03/0 is there twice"):
        wrong.save(tmp_path / "scenes.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("speeds", "waited"),
    [
        ([4.0] * 8 + [0.3, 0.0, 2.0, 2.0, 2.0], [0] * 9 + [1, 2, 3, 4]),
        ([4.0] * 8 + [0.6, 0.6, 2.0, 2.0, 2.0], [0] * 13),
        ([0.0] + [2.0] * 4, [0] * 5),
    ],
    ids=["stops at its line", "rolls on", "stops far before it"],
)
def test_a_moment_knows_for_how_long_a_vehicle_has_stopped_at_its_line(speeds: list[float], waited: list[int]) -> None:
    """Up to the step before, as a prediction counts the present one itself."""
    bendplatz = Intersection.load("bendplatz")
    route = next(one for one in bendplatz.routes if one.must_stop)
    speed = np.array(speeds, np.float32)
    one = replace(
        track("03/1", route.index, 2, len(speeds)),
        speed=speed,
        position=(route.stop_line - 11.0 + np.cumsum(0.2 * speed)).astype(np.float32),
        observed=np.ones(len(speeds), np.bool_),
    )
    scenes = Scenes(bendplatz, (Scene("03/0", "03", "train", 0.0, 2 + len(speeds), (one,)),), {}, {})
    found = [scenes.at(0, 0.2 * (2 + step)) for step in range(len(speeds))]
    assert [0 if moment.waited is None else int(moment.waited[0]) for moment in found] == waited
    assert all(moment.hold is None for moment in found if moment.waited is None)


def test_tracks_in_a_row_are_joined_without_a_copy() -> None:
    train = Scenes.load("t_junction").select("train")
    tracks = [track for scene in train for track in scene.tracks]
    for name in ("position", "speed", "acceleration", "observed"):
        whole = joined(tracks, name)
        np.testing.assert_array_equal(whole, np.concatenate([getattr(track, name) for track in tracks]))
        assert np.shares_memory(whole, getattr(tracks[-1], name))


@pytest.mark.parametrize("choose", [lambda tracks: tracks[::2], lambda tracks: tracks[::-1], lambda tracks: tracks[:0]])
def test_tracks_from_here_and_there_are_joined_in_their_order(choose: Callable[[list[Track]], list[Track]]) -> None:
    tracks = choose([track for scene in Scenes.load("t_junction") for track in scene.tracks])
    for name, dtype in (("position", np.float32), ("observed", np.bool_)):
        found = joined(tracks, name)
        assert found.dtype == dtype
        assert found.tolist() == [value for track in tracks for value in getattr(track, name).tolist()]
