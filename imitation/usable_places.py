"""Scenes that a driver can learn from: checked before a training begins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from intersection_env.constants import DT, STEPS
from intersection_env.scenes.places import load_places
from intersection_env.scenes.scene import SPLITS
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.recorded_tracks import steps_to_act
from intersection_env.worlds.replay import ReplayWorlds


def usable_places(paths: Sequence[Path], maps: Sequence[str] = ()) -> tuple[Scenes, ...]:
    """The scenes of each file, each with vehicles to learn from and others to watch for 10 s.

    Raises:
        ValueError: a file is damaged or made for something else, or a split of it has no such vehicle.
        OSError: one cannot be read.
    """
    places = load_places(paths, maps)
    for path, place in zip(paths, places, strict=True):
        for split, steps in zip(SPLITS, (1, STEPS + 1), strict=False):
            try:
                recorded = ReplayWorlds(place, split=split).tracks
            except ValueError as error:
                raise ValueError(f'{path}, split "{split}": {error}') from None
            tracks = [track for scene in recorded.scenes for track in scene.tracks]
            if max(steps_to_act(tracks[index]) for index in recorded.actors) < steps:
                raise ValueError(f'{path}, split "{split}": nobody is recorded for more than {STEPS * DT:.0f} s')
    return places
