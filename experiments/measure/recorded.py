"""The recordings that a measurement is of: loaded, and what is to be said about them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from intersection_env.scenes.places import load_places
from intersection_env.scenes.scenes import Scenes


def places_of(scenes: Sequence[Path], maps: Sequence[str], split: str) -> tuple[Scenes, ...]:
    """As of `load_places`, of which some scenes are of the split; says where intervals have no width.

    Raises:
        FileNotFoundError: as of `load_places`.
        ValueError: likewise, or no scene is of the split.
    """
    places = load_places(scenes, maps)
    recordings = {scene.recording for place in places for scene in place.select(split)}
    names = ", ".join(map(str, scenes))
    if not recordings:
        splits = sorted({scene.split for place in places for scene in place})
        raise ValueError(
            f'{names}: no scene of split "{split}"; there are scenes of {", ".join(splits) or "none"}'
            " (python -m data.build divides three recordings or more)"
        )
    if len(recordings) == 1:
        print(
            f'{names}: of split "{split}" there is one recording ({min(recordings)}); intervals are over recordings,'
            " and have no width here",
            file=sys.stderr,
        )
    return places
