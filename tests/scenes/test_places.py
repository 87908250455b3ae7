"""Scenes of several places: each on its map, ids apart, and what is wrong is said with the file and the map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from intersection_env import Intersection, Scenes
from intersection_env.evaluation.moments import moments_of
from intersection_env.evaluation.places import moments_in
from intersection_env.scenes.places import ALL_SCENES, PAPERS_SCENES, load_places, map_names
from intersection_env.scenes.scenes import shipped_scenes
from tests.support.own_place import own_map, own_scenes
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return own_scenes(tmp_path_factory.mktemp("own"))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scenes on Bendplatz, of recordings 00, 12 and 15."""
    path = tmp_path_factory.mktemp("small") / "small.npz"
    small_scenes("train", "development", "validation", each=1).save(path)
    return path


def test_names_that_ship_are_good_wherever_a_path_is() -> None:
    assert [str(path) for path in ALL_SCENES] == list(shipped_scenes())
    assert set(PAPERS_SCENES) <= set(ALL_SCENES)
    for name in ("bendplatz", Path("bendplatz")):
        assert Scenes.load(name).intersection == Intersection.load("bendplatz")
    assert map_names(load_places(PAPERS_SCENES)) == ["bendplatz"]


def test_each_file_lies_on_its_own_map(own: tuple[Path, Path], small: Path) -> None:
    path, map = own
    known: list[Sequence[str | Path | Intersection]] = [[map], [str(map)], [Intersection.load(map)], ["bendplatz", map]]
    for maps in known:
        assert map_names(load_places([small, path], maps)) == ["bendplatz", "mine"]
    assert map_names(load_places([path, small], [map])) == ["mine", "bendplatz"]


def test_recordings_that_share_an_id_are_told_apart(own: tuple[Path, Path], small: Path) -> None:
    places = load_places([small, own[0]], [own[1]])
    recordings = [{scene.recording for scene in place} for place in places]
    assert recordings == [
        {f"{small}: {id}" for id in ("00", "12", "15")},
        {f"{own[0]}: {id}" for id in ("00", "01", "02")},
    ]
    assert places[0][0].id == f"{small}: 00/0"
    assert {scene.recording for scene in load_places([small])[0]} == {"00", "12", "15"}, "alone it needs no other name"


def test_moments_of_several_places_are_those_of_each(own: tuple[Path, Path], small: Path) -> None:
    places = load_places([small, own[0]], [own[1]])
    for split in ("train", None):
        each = [moments_of(place if split is None else place.select(split))[0] for place in places]
        found, refused = moments_in(places, split)
        assert [str(one.scene.id) for one in found] == [one.scene.id for part in each for one in part]
        assert not refused
        assert min(map(len, each)) > 3


def test_what_is_wrong_with_scenes_and_maps_is_said(own: tuple[Path, Path], small: Path, tmp_path: Path) -> None:
    path, map = own
    with pytest.raises(
        ValueError, match=r'mine\.npz: its map "mine" does not ship; give it: --map MAP\.json, in Python'
    ):
        load_places([small, path])
    with pytest.raises(ValueError, match=r'map ".*other\.json": none of the scenes lie on it \(.*small\.npz\)'):
        load_places([small], [own_map(tmp_path, "other")])
    changed = json.loads(map.read_text(encoding="utf-8"))
    changed["arms"]["S"]["speed_limit_kmh"] = 50
    (tmp_path / "mine.json").write_text(json.dumps(changed), encoding="utf-8")
    with pytest.raises(ValueError, match=r'mine\.npz: made on map "mine" with checksum \w+, but map "mine" now has'):
        load_places([path], [tmp_path / "mine.json"])
    with pytest.raises(ValueError, match="the same scenes twice"):
        load_places([small, small.parent / "." / small.name])
    with pytest.raises(ValueError, match="no scenes; wanted scenes files, or names of scenes that ship"):
        load_places([])
    with pytest.raises(FileNotFoundError, match='"nowhere": no scenes file at this path'):
        load_places(["nowhere"])
    (tmp_path / "damaged.npz").write_bytes(path.read_bytes()[:500])
    with pytest.raises(ValueError, match=r"damaged\.npz: not a scenes file") as refused:
        load_places([tmp_path / "damaged.npz"])
    assert str(refused.value).count("damaged.npz") == 1
