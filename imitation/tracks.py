"""The recorded tracks of a split, each driven in a replay of its own from its first recorded step on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.replay import ReplayWorlds

WORLDS = 256


def replays(scenes: str | Path | Scenes, split: str | None, gap: str | Path = "recording") -> ReplayWorlds:
    """Worlds for `each_track`, which start no track by themselves.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    worlds = ReplayWorlds(scenes, split=split, gap=gap, worlds=WORLDS, autoreset="off")
    worlds.reset(seed=0)
    return worlds


def each_track(worlds: ReplayWorlds) -> Iterator[NDArray[np.bool_]]:
    """Starts every track that may act, as many at a time as there are worlds; yields in which worlds one does."""
    actors, count = worlds.tracks.actors, len(worlds.action)
    for first in range(0, len(actors), count):
        tracks = actors[first : first + count]
        for world, track in enumerate(tracks):
            worlds.start(world, int(track))
        yield np.arange(count) < len(tracks)
