"""The tracks of recorded scenes as the core's replay reads them, and the way from a scene's and a vehicle's name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, SupportsInt, TypeGuard

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import BICYCLE_MAX_SPEED
from intersection_env.scenes.file import joined, pack_tracks
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes

SAMPLES = ("position", "speed", "observed")
LEAST_STEPS = 5  # ours: an episode that a reset draws lasts 1 s or more


@dataclass(frozen=True, eq=False)
class RecordedTracks:
    """All tracks of some scenes, in one row.

    arrays: of the scenes and tracks, as in the scenes file; track_max_speed [m/s] beside them.
    actors: int32, the tracks that a reset may draw: cars and trucks that are recorded for 1 s or more.
    scene_id, track_id: (track,) str as objects.
    scene_number, track_number: (track,) int64, the scene among the scenes and the track within its scene.
    """

    scenes: Scenes
    arrays: dict[str, NDArray[Any]]
    actors: NDArray[np.int32]
    scene_id: NDArray[np.object_]
    track_id: NDArray[np.object_]
    scene_number: NDArray[np.int64]
    track_number: NDArray[np.int64]
    fastest: float
    """The highest recorded speed [m/s]."""

    @classmethod
    def of(cls, scenes: Scenes) -> RecordedTracks:
        """The tracks of all these scenes.

        Raises:
            ValueError: none of their vehicles can act.
        """
        arrays = pack_tracks(scenes.scenes)
        bicycle = arrays["track_class"] == "bicycle"
        tracks = [track for scene in scenes for track in scene.tracks]
        counts = [len(scene.tracks) for scene in scenes]
        can_act = np.array([steps_to_act(track) >= LEAST_STEPS for track in tracks], np.bool_)
        actors = np.flatnonzero(can_act & ~bicycle).astype(np.int32)
        if not len(actors):
            others = int(can_act.sum())
            cause = f"{others} are, but they are bicycles" if others else "no bicycle either"
            raise ValueError(
                f"none of the {len(tracks)} vehicles in {len(scenes)} scenes is a car or truck that is recorded "
                f"for 1 s or more ({cause})"
            )
        arrays["track_route"] = arrays["track_route"].astype(np.int32)
        arrays["track_max_speed"] = np.where(bicycle, BICYCLE_MAX_SPEED, np.inf).astype(np.float32)
        return cls(
            scenes,
            arrays,
            actors,
            np.repeat(np.array([scene.id for scene in scenes], object), counts),
            np.array([track.id for track in tracks], object),
            np.repeat(np.arange(len(counts)), counts),
            np.concatenate([np.arange(count) for count in counts]),
            max(float(track.speed.max()) for track in tracks),
        )

    def samples(self) -> dict[str, NDArray[Any]]:
        """What the core's replay is given of each sample, joined anew: the scenes keep it, and the core."""
        tracks = [track for scene in self.scenes for track in scene.tracks]
        return {name: joined(tracks, name) for name in SAMPLES}

    def recorded(self, track: int, time: int) -> tuple[float, float]:
        """Position and speed of a track at a step of its scene at which it is there."""
        found = self.scenes[int(self.scene_number[track])].tracks[int(self.track_number[track])]
        return float(found.position[time - found.start]), float(found.speed[time - found.start])

    def present(self, track: int, time: int) -> NDArray[np.intp]:
        """The tracks that are there at a step of this track's scene."""
        offsets = self.arrays["scene_tracks"]
        scene = int(np.searchsorted(offsets, track, side="right")) - 1
        inside = np.arange(offsets[scene], offsets[scene + 1])
        start = self.arrays["track_start"][inside]
        steps = np.diff(self.arrays["track_samples"])[inside]
        return inside[(start <= time) & (time < start + steps)]

    def names(self, scene: SupportsInt, vehicle: SupportsInt) -> tuple[str, str]:
        """The ids of the scene of this number, and of the track of that number in it."""
        return self.scenes[int(scene)].id, self.scenes[int(scene)].tracks[int(vehicle)].id

    def choose(self, options: Mapping[str, Any], random: np.random.Generator) -> int:
        """The index of the track that options `scene` and `vehicle` (ids or numbers) name.

        Without a vehicle, one of the scene's is drawn. A vehicle alone must be an id that only one scene has.

        Raises:
            ValueError: an option is None, no such scene, no such vehicle in it, a vehicle that cannot act, or one that
                leaves open which scene is meant.
        """
        for name, value in options.items():
            if value is None:
                raise ValueError(f'option "{name}" is None; wanted an id or a number, or no such option')
        vehicle = options.get("vehicle")
        scene = self._scene(options.get("scene"), vehicle)
        begin = int(self.arrays["scene_tracks"][scene])
        if vehicle is not None:
            return begin + self._in_scene(self.scenes[scene], vehicle)
        inside = self.actors[(self.actors >= begin) & (self.actors < self.arrays["scene_tracks"][scene + 1])]
        if not len(inside):
            raise ValueError(f"no car or truck of scene {self.scenes[scene].id} is recorded for 1 s or more")
        return int(random.choice(inside))

    def _scene(self, scene: object, vehicle: object) -> int:
        if scene is None:
            found = np.unique(self.scene_id[self.track_id == vehicle].astype(str))
            if not isinstance(vehicle, str) or not len(found):
                raise ValueError(f'option "vehicle" is {vehicle!r}; without a "scene" it must be the id of a track')
            if len(found) > 1:
                raise ValueError(f'vehicle "{vehicle}" is in scenes {", ".join(found)}; name one as option "scene"')
            scene = str(found[0])
        ids = [one.id for one in self.scenes]
        if isinstance(scene, str) and scene in ids:
            return ids.index(scene)
        if _is_number(scene) and 0 <= scene < len(ids):
            return int(scene)
        raise ValueError(f'option "scene" is {scene!r}; wanted an id, as "{ids[0]}", or a number below {len(ids)}')

    @staticmethod
    def _in_scene(scene: Scene, vehicle: object) -> int:
        ids = [track.id for track in scene.tracks]
        if isinstance(vehicle, str) and vehicle in ids:
            index = ids.index(vehicle)
        elif _is_number(vehicle) and 0 <= vehicle < len(ids):
            index = int(vehicle)
        else:
            wanted = f'an id, as "{ids[0]}", or a number below {len(ids)}'
            raise ValueError(f'option "vehicle" is {vehicle!r}; in scene {scene.id} wanted {wanted}')
        if steps_to_act(scene.tracks[index]) < 1:
            raise ValueError(f"vehicle {ids[index]} cannot act: scene {scene.id} has at most one recorded state of it")
        return index


def _is_number(value: object) -> TypeGuard[int | np.integer]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def steps_to_act(track: Track) -> int:
    """How many steps follow the first recorded state of a track; -1 where there is no recorded one."""
    recorded = np.flatnonzero(track.observed)
    return len(track.position) - 1 - int(recorded[0]) if len(recorded) else -1
