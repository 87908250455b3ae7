"""Recorded scenes: load, check, slice, and look at one moment as `Traffic`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from intersection_env import _core
from intersection_env.arguments import name_or_file
from intersection_env.constants import BICYCLE_MAX_SPEED, DT
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.file import pack, read_scenes_file, unpack, write_scenes_file
from intersection_env.scenes.scene import SPLITS, Scene, Track
from intersection_env.traffic import Traffic, naming

__all__ = ["SPLITS", "Scene", "Scenes", "Track"]

RECORDED = Path(__file__).parent


@dataclass(frozen=True, eq=False)
class Scenes:
    """The scenes of one intersection; a sequence, by number or by id.

    provenance: where they come from; dropped: what was left out on the way, counted by reason. source: what `load`
    was given, if that alone gives the same scenes again.
    """

    intersection: Intersection
    scenes: tuple[Scene, ...]
    provenance: dict[str, Any]
    dropped: dict[str, float]
    source: str | None = field(default=None, init=False)  # so that `replace` leaves it out

    @classmethod
    def load(cls, name: str | Path, intersection: str | Path | Intersection | None = None) -> Scenes:
        """The scenes that ship under a name, or those in the file at a path; several: `load_places`.

        The intersection is the shipped map named in the file, unless another is given: a map, or its name or file.

        Raises:
            TypeError: neither a name nor a path.
            FileNotFoundError: there is no such file.
            ValueError: the file is damaged, of another version, or belongs to another map; the message
                names file and array.
        """
        path, source = scenes_path(name), str(name) if intersection is None else None
        if intersection is not None and not isinstance(intersection, Intersection):
            intersection = Intersection.load(intersection)
        header, arrays = read_scenes_file(path)
        try:
            intersection = _its_intersection(header, intersection)
            scenes = unpack(arrays, intersection)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        loaded = cls(intersection, scenes, header["provenance"], header["dropped"])
        object.__setattr__(loaded, "source", source)
        return loaded

    def save(self, path: str | Path) -> None:
        """Writes the scenes file; at no moment is there half a file under that name.

        Raises:
            ValueError: the scenes contradict themselves; the message names the array.
            OSError: the file cannot be written.
        """
        arrays = pack(self.scenes)
        unpack(arrays, self.intersection)
        header = {
            "map": {"name": self.intersection.name, "checksum": self.intersection.checksum},
            "dt": DT,
            "provenance": self.provenance,
            "dropped": self.dropped,
        }
        write_scenes_file(Path(path), header, arrays)

    def select(self, split: str) -> Scenes:
        """The scenes of one split: "train", "development" or "validation".

        Raises:
            ValueError: there is no split of that name.
        """
        if split not in SPLITS:
            raise ValueError(f'split is "{split}"; wanted one of {", ".join(SPLITS)}')
        return replace(self, scenes=tuple(scene for scene in self.scenes if scene.split == split))

    def __repr__(self) -> str:
        return f"Scenes({self.intersection.name!r}, {len(self)} scenes)"

    def __len__(self) -> int:
        return len(self.scenes)

    def __iter__(self) -> Iterator[Scene]:
        return iter(self.scenes)

    @cached_property
    def _by_id(self) -> dict[str, Scene]:
        return {scene.id: scene for scene in self.scenes}

    def __getitem__(self, key: int | str) -> Scene:
        """The scene of that number, or of that id.

        Raises:
            KeyError: no scene has that id.
            IndexError: there are fewer scenes.
        """
        if isinstance(key, str):
            if key not in self._by_id:
                raise KeyError(f'no scene "{key}" among {len(self)}; ids are recording and number, as "03/2"')
            return self._by_id[key]
        return self.scenes[key]

    def at(self, scene: Scene | int | str, time: float) -> Traffic:
        """The vehicles present `time` seconds after the scene's begin, in the order of its tracks.

        Who has made a stop at its line by then, as its track tells, need not make another (`Traffic.waited`).

        Raises:
            ValueError: the time is not a multiple of 0.2 s within the scene.
        """
        scene = scene if isinstance(scene, Scene) else self[scene]
        step = round(time / DT) if np.isfinite(time) else -1
        if not 0 <= step < scene.steps or abs(step * DT - time) > 1e-6:
            raise ValueError(
                f"time is {time} s; scene {scene.id} has states every 0.2 s from 0 to {scene.duration:.1f} s"
            )
        tracks = [track for track in scene.tracks if track.start <= step < track.stop]
        bicycle = [track.road_user == "bicycle" for track in tracks]
        columns: dict[str, Any] = {
            "route": np.array([track.route for track in tracks], dtype=np.int32),
            "position": np.array([track.position[step - track.start] for track in tracks], dtype=np.float32),
            "speed": np.array([track.speed[step - track.start] for track in tracks], dtype=np.float32),
            "length": np.array([track.length for track in tracks], dtype=np.float32),
            "width": np.array([track.width for track in tracks], dtype=np.float32),
            "max_speed": np.where(bicycle, BICYCLE_MAX_SPEED, np.inf).astype(np.float32),
        }
        ids = tuple(track.id for track in tracks)
        waited = np.array([self._waited(track, step) for track in tracks], np.int32)
        if waited.any():
            core = self.intersection.core
            with naming(ids):
                enters = _core.committed(core, _core.Traffic(core, **columns)).astype(np.bool_)
            columns |= {"delta": enters, "hold": np.full(len(tracks), -1, np.int16), "waited": waited}
        return Traffic(self.intersection, ids, **columns)

    def _waited(self, track: Track, step: int) -> int:
        """For how many steps before this one a vehicle has stopped at its line or gone on from there."""
        route = self.intersection.routes[track.route]
        before = slice(0, step - track.start)
        to_line = np.float32(route.stop_line) - (track.position[before] + np.float32(0.5 * track.length))
        stops = route.must_stop & (track.speed[before] < _core.STOPPED) & (to_line < _core.AT_LINE)
        return int(stops[stops.argmax() :].size) if stops.any() else 0


def shipped_scenes() -> tuple[str, ...]:
    """The names of the scenes that ship, in order."""
    return tuple(sorted(path.stem for path in RECORDED.glob("*.npz")))


def scenes_path(name: str | Path) -> Path:
    """Where scenes lie: those that ship, by their name, or a scenes file.

    Raises:
        TypeError: neither a name nor a path.
        FileNotFoundError: nothing that ships, and no file.
    """
    path = name_or_file("scenes", name, shipped_scenes())
    if str(name) in shipped_scenes():
        return RECORDED / f"{name}.npz"
    if not path.is_file():
        names = ", ".join(shipped_scenes()) or "none"
        raise FileNotFoundError(f'"{name}": no scenes file at this path, nor one that ships under this name ({names})')
    return path


def _its_intersection(header: dict[str, Any], intersection: Intersection | None) -> Intersection:
    name, checksum = header["map"]["name"], header["map"]["checksum"]
    if abs(header["dt"] - DT) > 1e-9:
        raise ValueError(f"dt is {header['dt']} s, this package reads {DT} s")
    if intersection is None:
        try:
            intersection = Intersection.load(name)
        except (ValueError, OSError):
            raise ValueError(
                f'its map "{name}" does not ship; give it: --map MAP.json, in Python map= (Scenes.load(path, map))'
            ) from None
    if name != intersection.name:
        raise ValueError(f'made on map "{name}", not on map "{intersection.name}"; give the map that they were made on')
    if checksum != intersection.checksum:
        raise ValueError(
            f'made on map "{name}" with checksum {checksum}, but map "{intersection.name}" now has'
            f" {intersection.checksum}; build the scenes again (python -m data.build), or give the map that they were"
            " made on (--map)"
        )
    return intersection
