"""Moments of all places that ship."""

from __future__ import annotations

from intersection_env.evaluation.moments import Moment, contested
from intersection_env.evaluation.places import moments_in
from intersection_env.scenes.places import ALL_SCENES, load_places

PLACES = load_places(ALL_SCENES)


def some_moments() -> list[Moment]:
    """Of unlike sizes, most of them contested."""
    every = [moments_in(place, "development", 20.0)[0] for place in PLACES]
    return [one for own in every for one in (*contested(own)[:6], own[0])]
