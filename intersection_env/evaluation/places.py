"""The recorded moments of several places."""

from __future__ import annotations

from collections.abc import Sequence

from intersection_env.evaluation.moments import EVERY, Moment, moments_of
from intersection_env.scenes.places import each_place
from intersection_env.scenes.scenes import Scenes


def moments_in(
    scenes: Scenes | Sequence[Scenes], split: str | None, every: float = EVERY
) -> tuple[list[Moment], dict[str, str]]:
    """As of `moments_of`, of one split (None: all) of one place or several, whose scenes' ids differ."""
    found: list[Moment] = []
    refused: dict[str, str] = {}
    for place in each_place(scenes):
        own, why = moments_of(place if split is None else place.select(split), every)
        found += own
        refused |= why
    return found, refused
