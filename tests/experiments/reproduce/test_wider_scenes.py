"""Recordings of drivers who differ more are simulated of the places that ship, once."""

from __future__ import annotations

from pathlib import Path

import pytest

from data.sumo.places import T_JUNCTION
from experiments.reproduce import wider_scenes as wider
from intersection_env import Scenes
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.limits import with_limits


def test_they_are_of_all_that_is_learned_from_and_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[int]] = []
    place = Intersection.load("t_junction")

    class Pool:
        def __init__(self, workers: int | None) -> None:
            assert workers

        def __enter__(self) -> Pool:
            return self

        def __exit__(self, *_: object) -> None: ...

        def map(self, work: object, numbers: list[int]) -> list[None]:
            asked.append(numbers)
            return []

    monkeypatch.setattr(wider, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(wider, "build", lambda folder, place: Scenes(place, (), {}, {}))
    for _ in range(2):
        assert wider.wider_scenes([place], tmp_path) == [tmp_path / "t_junction.npz"]
    assert asked == [[*T_JUNCTION.numbers["train"], *T_JUNCTION.numbers["development"]]]
    assert Scenes.load(tmp_path / "t_junction.npz").intersection == place


def test_a_place_that_is_not_simulated_is_refused(tmp_path: Path) -> None:
    place = with_limits(Intersection.load("t_junction"), 2.0)
    place.name = "elsewhere"
    with pytest.raises(ValueError, match='map "elsewhere": recordings are simulated on bendplatz, t_junction'):
        wider.wider_scenes([place], tmp_path)
