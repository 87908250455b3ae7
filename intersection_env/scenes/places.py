"""Scenes of several places: a scenes file each, on maps that ship or on one's own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.file import map_of_scenes_file
from intersection_env.scenes.scenes import Scenes, scenes_path, shipped_scenes

ALL_SCENES = tuple(Path(name) for name in shipped_scenes())
"""The scenes that ship, by name."""
PAPERS_SCENES = (Path("bendplatz"),)
"""Those of the paper's place, among them."""


def load_places(scenes: Sequence[str | Path], maps: Sequence[str | Path | Intersection] = ()) -> tuple[Scenes, ...]:
    """The scenes of each file, in their order; no two of them share the id of a recording or a scene.

    Where files do, as recordings are numbered from 00 on in many a folder, "03" becomes "FILE: 03", and so on, where
    FILE is what the file was called here.

    Args:
        scenes: names of scenes that ship, or scenes files.
        maps: maps, or names or files of maps, on which scenes may lie beside the maps that ship.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: no scenes, the same twice, a file as of `Scenes.load`, or a map on which none of the scenes lie.
    """
    if not scenes:
        raise ValueError(
            f"no scenes; wanted scenes files, or names of scenes that ship ({', '.join(shipped_scenes())})"
        )
    paths = [scenes_path(name) for name in scenes]
    for place, path in enumerate(paths):
        if path.resolve() in [other.resolve() for other in paths[:place]]:
            raise ValueError(f'"{scenes[place]}": the same scenes twice')
    given = [one if isinstance(one, Intersection) else Intersection.load(one) for one in maps]
    found = [Scenes.load(path, _among(given, *map_of_scenes_file(path))) for path in paths]
    for name, one in zip(maps, given, strict=True):
        if one not in [place.intersection for place in found]:
            raise ValueError(f'map "{name}": none of the scenes lie on it ({", ".join(map(str, scenes))})')
    seen = Counter(id for place in found for id in {scene.recording for scene in place})
    return tuple(
        _called(str(name), place) if any(seen[scene.recording] > 1 for scene in place) else place
        for name, place in zip(scenes, found, strict=True)
    )


def each_place(scenes: Scenes | Sequence[Scenes]) -> tuple[Scenes, ...]:
    """Of one place or several, each."""
    return (scenes,) if isinstance(scenes, Scenes) else tuple(scenes)


def map_names(places: Sequence[Scenes]) -> list[str]:
    """The names of their maps."""
    return [place.intersection.name for place in places]


def _among(given: Sequence[Intersection], name: str, checksum: str) -> Intersection | None:
    """The map of this checksum, or else one of this name, of which `Scenes.load` says what is wrong with it."""
    same = [one for one in given if one.checksum == checksum]
    return next(iter([*same, *(one for one in given if one.name == name)]), None)


def _called(name: str, place: Scenes) -> Scenes:
    renamed = (
        replace(scene, id=f"{name}: {scene.id}", recording=f"{name}: {scene.recording}") for scene in place.scenes
    )
    return replace(place, scenes=tuple(renamed))
