"""Recordings of drivers who differ more, and of larger places, are simulated of the places that ship, once."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from data.sumo.places import T_JUNCTION
from experiments.reproduce import simulated_scenes as simulated
from intersection_env import Scenes
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.limits import with_limits


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[dict[str, float], list[int]]]:
    """What recordings are asked for: how they differ, and their numbers; none is made."""
    found: list[tuple[dict[str, float], list[int]]] = []

    class Pool:
        def __init__(self, workers: int | None) -> None:
            assert workers

        def __enter__(self) -> Pool:
            return self

        def __exit__(self, *_: object) -> None: ...

        def map(self, work: Any, numbers: Iterable[int]) -> list[None]:
            found.append(({key: value for key, value in work.keywords.items() if key != "folder"}, list(numbers)))
            return []

    monkeypatch.setattr(simulated, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(simulated, "build", lambda folder, place: Scenes(place, (), {}, {}))
    return found


def test_wider_ones_are_of_all_that_is_learned_from_and_made_once(
    tmp_path: Path, asked: list[tuple[dict[str, float], list[int]]]
) -> None:
    place = Intersection.load("t_junction")
    for _ in range(2):
        assert simulated.wider_scenes([place], tmp_path) == [tmp_path / "t_junction.npz"]
    learned, seen = (list(T_JUNCTION.numbers[split]) for split in ("train", "development"))
    assert asked == [({"wider": 2.0, "larger": 1.0}, [*learned, *seen])]
    assert Scenes.load(tmp_path / "t_junction.npz").intersection == place
    split = json.loads((tmp_path / "t_junction" / "settings.json").read_text())["split"]
    assert split == {"train": [f"{one:02d}" for one in learned], "development": [f"{one:02d}" for one in seen]}


def test_larger_ones_are_few_of_each_size_and_made_once(
    tmp_path: Path, asked: list[tuple[dict[str, float], list[int]]]
) -> None:
    for _ in range(2):
        found = simulated.larger_scenes([Intersection.load("t_junction")], tmp_path)
        assert [file.name for file, _ in found] == ["t_junction_150.npz", "t_junction_220.npz"]
        for file, source in found:
            assert Scenes.load(file, Intersection.load(source)).intersection.name == file.stem
    few = [*T_JUNCTION.numbers["train"][:2], *T_JUNCTION.numbers["development"][:1]]
    assert asked == [({"wider": 1.0, "larger": times}, few) for times in (1.5, 2.2)]


def test_a_place_that_is_not_simulated_is_refused(tmp_path: Path) -> None:
    place = with_limits(Intersection.load("t_junction"), 2.0)
    place.name = "elsewhere"
    for scenes in (simulated.wider_scenes, simulated.larger_scenes):
        with pytest.raises(ValueError, match='map "elsewhere": recordings are simulated on bendplatz, t_junction'):
            scenes([place], tmp_path)
