"""Worlds in which one vehicle of a recorded scene acts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import whole_number
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.named import gap_decider
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.life import Autoreset, Bodies, Worlds
from intersection_env.worlds.recorded_tracks import RecordedTracks


class ReplayWorlds(Worlds):
    """Worlds in which one vehicle of a recorded scene acts among the recorded others.

    Attributes:
        tracks: the recorded tracks; `track` is an index into them.
        action: (world,) in [-1, 1], to be written; times 6 m/s². Not checked, unlike in an environment: clip.
        observation, final_observation: (world, 12), as in `ClosedLoopWorlds`; the latter where terminated or truncated.
        reward: (world,); paper, Table II.
        terminated, truncated: (world,) bool.
        expert_observation: (world, 12), what the recorded vehicle saw at the step of `observation`.
        expert_acceleration: (world,) [m/s²], what takes it on to its next recorded speed.
        track: (world,) int32, who acts.
        time: (world,) int32, the step of its scene.
    """

    core: _core.Replay
    expert_observation: NDArray[np.float32]
    expert_acceleration: NDArray[np.float32]
    track: NDArray[np.int32]
    time: NDArray[np.int32]

    def __init__(
        self,
        scenes: str | Path | Scenes = "bendplatz",
        *,
        map: str | Path | Intersection | None = None,
        split: str | None = "train",
        gap: str | Path = "recording",
        worlds: int = 1,
        bodies: Bodies = "circles",
        autoreset: Autoreset = "same_step",
        threads: int = 1,
        isa: str | None = None,
    ) -> None:
        """Worlds in the scenes of one file; call `reset` first.

        Args:
            scenes: a scenes file's name or path, or the scenes themselves.
            map: the map that the scenes lie on, its name or its file; None: one that ships.
            split: `"train"`, `"development"`, `"validation"`, or None for all scenes.
            gap: who decides about gaps: the `"recording"`, or as in `ClosedLoopWorlds`.
            worlds, bodies, autoreset, threads, isa: as in `ClosedLoopWorlds`.

        Raises:
            FileNotFoundError: there is no such file.
            TypeError: a count that is no whole number.
            ValueError: an impossible argument, or a scenes file that is damaged or of another map or version.
        """
        worlds, threads = whole_number("worlds", worlds), whole_number("threads", threads)
        super().__init__(
            {
                "scenes": scenes,
                "map": map,
                "split": split,
                "gap": gap,
                "worlds": worlds,
                "bodies": bodies,
                "autoreset": autoreset,
                "threads": threads,
                "isa": isa,
            }
        )
        recorded = _recorded(scenes, map)
        recorded = recorded if split is None else recorded.select(split)
        if not len(recorded):
            where = "the scenes handed over" if isinstance(scenes, Scenes) else f"scenes {scenes}"
            raise ValueError(f"{where}: " + ("there are none" if split is None else f'no scene of split "{split}"'))
        self.intersection = recorded.intersection
        self.tracks = RecordedTracks.of(recorded)
        self.is_recorded = str(gap) == "recording"
        decider = gap_decider("critical_gap" if self.is_recorded else gap)
        self.policy = _core.Policy(decider.text(), str(gap))
        self.core = self._made(worlds)
        self._bind("action", "observation", "final_observation", "reward", "terminated", "truncated")
        self._bind("expert_observation", "expert_acceleration", "track", "time")

    def start(self, world: int, track: int) -> None:
        """Begins one world's episode with this track, at its first recorded step."""
        self.core.start(world, track)
        self.is_reset = True

    def _made(self, worlds: int) -> _core.Replay:
        tracks = self.tracks
        given = (self._arguments[name] for name in ("autoreset", "threads", "isa", "bodies"))
        arrays = tracks.arrays | tracks.samples()
        return _core.Replay(
            self.intersection.core, self.policy, self.is_recorded, arrays, tracks.actors, worlds, *given
        )


def _recorded(scenes: str | Path | Scenes, map: str | Path | Intersection | None) -> Scenes:
    if not isinstance(scenes, Scenes):
        return Scenes.load(scenes, map)
    if map is not None:
        intersection = map if isinstance(map, Intersection) else Intersection.load(map)
        if intersection != scenes.intersection:
            raise ValueError(
                f'map: the scenes handed over lie on map "{scenes.intersection.name}"'
                f' ({scenes.intersection.checksum}), not on "{intersection.name}" ({intersection.checksum})'
            )
    return scenes
