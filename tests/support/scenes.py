"""Few recorded scenes, where the tests need no more."""

from __future__ import annotations

from dataclasses import replace

from intersection_env import Scenes

LEAST = 30.0  # [s]; of a shorter scene few moments have 10 s left


def small_scenes(*splits: str, each: int = 3, place: str = "bendplatz") -> Scenes:
    """The first scenes that ship of each of these splits, of those that are long enough to predict in."""
    scenes = Scenes.load(place)
    long = [[scene for scene in scenes.select(split) if scene.duration >= LEAST] for split in splits]
    return replace(scenes, scenes=tuple(scene for of_split in long for scene in of_split[:each]))
