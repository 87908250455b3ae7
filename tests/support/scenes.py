"""Few recorded scenes, where the tests need no more."""

from __future__ import annotations

from dataclasses import replace

from intersection_env import Scenes


def small_scenes(*splits: str, each: int = 3) -> Scenes:
    """The first scenes that ship of each of these splits."""
    scenes = Scenes.load("bendplatz")
    return replace(scenes, scenes=tuple(scene for split in splits for scene in scenes.select(split).scenes[:each]))
