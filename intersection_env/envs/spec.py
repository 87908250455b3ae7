"""What an environment was made with, by names: so that Gymnasium can write its spec as JSON."""

from __future__ import annotations

import dataclasses
from enum import Enum
from pathlib import Path
from typing import Any

from gymnasium.envs.registration import EnvSpec

from intersection_env.maps.intersection import Intersection, shipped_maps
from intersection_env.scenes.scenes import Scenes


def by_name(spec: EnvSpec | None) -> EnvSpec | None:
    """The spec with scenes, maps and files by the names that make the same environment again.

    What has no name stays as it is, and `spec.to_json()` then refuses it: scenes of one's own making, a selection of
    some, a map that does not ship.
    """
    if spec is None:
        return None
    return dataclasses.replace(spec, kwargs={key: _named(value) for key, value in spec.kwargs.items()})


def _named(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Scenes):
        return value.source or value
    if isinstance(value, Intersection) and value.name in shipped_maps() and value == Intersection.load(value.name):
        return value.name
    return value
