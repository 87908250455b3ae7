"""The batched worlds: thousands of simulated intersections, stepped at once on buffers that the core owns.

Every array named here is a view of the core's memory, valid as long as the worlds are: write `action`, call `step()`,
read the others, and copy what is to outlive the next step. `ClosedLoop` and `Replay` are views of one such world.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import check_seed, check_state, whole_number
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.recorded_tracks import RecordedTracks

Autoreset = Literal["off", "same_step", "next_step"]
RULES = ("critical_gap", "sumo")


class _Worlds:
    """What both kinds of worlds share: their life from reset to reset, and their state."""

    core: _core.ClosedLoop | _core.Replay
    action: NDArray[np.float32]
    observation: NDArray[np.float32]
    final_observation: NDArray[np.float32]
    reward: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    def __init__(self, arguments: dict[str, Any]) -> None:
        self._arguments = arguments
        self.is_reset = False
        """Whether there has been a first `reset`."""

    def _bind(self, *names: str) -> None:
        for name in names:
            setattr(self, name, getattr(self.core, name))

    def reset(self, seed: int, desynchronise: bool = False) -> None:
        """Starts every world anew, each from its own random stream, which (seed, world) determines.

        desynchronise: begin in the midst of episodes, so that the worlds do not end together.

        Raises:
            TypeError, ValueError: a seed that is no whole number from 0 to 2^63 - 1.
            RuntimeError: there is no room on the map for so many vehicles.
        """
        self.core.reset(check_seed(seed), desynchronise)
        self.is_reset = True

    def reset_worlds(self, mask: NDArray[np.bool_]) -> None:
        """Starts the worlds where `mask` (world,) is true anew; their random streams go on."""
        self.core.reset_worlds(mask)

    def step(self) -> None:
        """One step of 0.2 s by `action`, which is trusted to be in [-1, 1]."""
        self.core.step()

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything that the future depends on, as copies."""
        return self.core.state()

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Goes back to a state; `observation` follows, rewards and flags are those of no step.

        Raises:
            TypeError, ValueError: the state is not one of such worlds; the message names the array.
        """
        check_state(state, self.core.state(), self._arguments.get("max_cycles"))
        self.core.set_state(state)
        self.is_reset = True

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self._arguments, self.state() if self.is_reset else None)


def _restored(kind: type[_Worlds], arguments: dict[str, Any], state: dict[str, NDArray[Any]] | None) -> _Worlds:
    worlds = kind(**arguments)
    if state is not None:
        worlds.set_state(state)
    return worlds


class ClosedLoopWorlds(_Worlds):
    """Worlds in which every vehicle acts; whoever leaves is reinserted.

    Attributes:
        action: (world, vehicle) in [-1, 1], to be written; times 6 m/s².
        observation: (world, vehicle, 12), the features of `intersection_env.ClosedLoop` in their units.
        final_observation: (world, vehicle, 12), the last ones of an episode or before a reinsertion; valid where
            terminated, truncated or reinserted.
        reward: (world, vehicle); paper, Table II.
        terminated, truncated, reinserted: (world, vehicle) bool.
        done: (world,) bool, the world ended with this step.
    """

    core: _core.ClosedLoop
    reinserted: NDArray[np.bool_]
    done: NDArray[np.bool_]

    def __init__(
        self,
        map: str | Path | Intersection = "bendplatz",
        *,
        worlds: int = 1,
        vehicles: int = 12,
        gap: str | Path = "critical_gap",
        max_cycles: int = 2000,
        autoreset: Autoreset = "same_step",
        threads: int = 1,
        isa: str | None = None,
    ) -> None:
        """Worlds on one map; call `reset` first.

        Args:
            map: a map's name or file, or the map itself.
            worlds: how many.
            vehicles: slots in each world, 1 to 64.
            gap: who decides about gaps: `"critical_gap"`, `"sumo"`, or a policy (name or file) with a gap network.
            max_cycles: steps after which a world ends.
            autoreset: `"off"`: a world that is done stays as it is until reset; `"same_step"`: it starts anew at once;
                `"next_step"`: it starts anew with the next step, whose action it ignores.
            threads: how many step the worlds, 0: one a core. They do not change what happens.
            isa: the core's kernel, by default the best one of this machine.

        Raises:
            TypeError: a count that is no whole number.
            ValueError: an impossible argument. Whether the map has room for so many vehicles only `reset` finds out.
            OSError: a map's or policy's file cannot be read.
        """
        worlds, vehicles = whole_number("worlds", worlds), whole_number("vehicles", vehicles)
        max_cycles, threads = whole_number("max_cycles", max_cycles), whole_number("threads", threads)
        super().__init__(
            {
                "map": map,
                "worlds": worlds,
                "vehicles": vehicles,
                "gap": gap,
                "max_cycles": max_cycles,
                "autoreset": autoreset,
                "threads": threads,
                "isa": isa,
            }
        )
        self.intersection = map if isinstance(map, Intersection) else Intersection.load(map)
        self.policy = _core.Policy(gap_decider(gap).text(), str(gap))
        self.core = _core.ClosedLoop(
            self.intersection.core, self.policy, worlds, vehicles, max_cycles, autoreset, threads, isa
        )
        self._bind("action", "observation", "final_observation", "reward")
        self._bind("terminated", "truncated", "reinserted", "done")


class ReplayWorlds(_Worlds):
    """Worlds in which one vehicle of a recorded scene acts among the recorded others.

    Attributes:
        tracks: the recorded tracks; `track` is an index into them.
        action: (world,) in [-1, 1], to be written; times 6 m/s².
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
        split: str | None = "train",
        gap: str | Path = "recording",
        worlds: int = 1,
        autoreset: Autoreset = "same_step",
        threads: int = 1,
        isa: str | None = None,
    ) -> None:
        """Worlds in the scenes of one file; call `reset` first.

        Args:
            scenes: a scenes file's name or path, or the scenes themselves.
            split: `"train"`, `"development"`, `"validation"`, or None for all scenes.
            gap: who decides about gaps: the `"recording"`, or as in `ClosedLoopWorlds`.
            worlds, autoreset, threads, isa: as in `ClosedLoopWorlds`.

        Raises:
            FileNotFoundError: there is no such file.
            TypeError: a count that is no whole number.
            ValueError: an impossible argument, or a scenes file that is damaged or of another map or version.
        """
        worlds, threads = whole_number("worlds", worlds), whole_number("threads", threads)
        super().__init__(
            {
                "scenes": scenes,
                "split": split,
                "gap": gap,
                "worlds": worlds,
                "autoreset": autoreset,
                "threads": threads,
                "isa": isa,
            }
        )
        recorded = scenes if isinstance(scenes, Scenes) else Scenes.load(scenes)
        recorded = recorded if split is None else recorded.select(split)
        if not len(recorded):
            where = "the scenes handed over" if isinstance(scenes, Scenes) else f"scenes {scenes}"
            raise ValueError(f"{where}: " + ("there are none" if split is None else f'no scene of split "{split}"'))
        self.intersection = recorded.intersection
        self.tracks = RecordedTracks.of(recorded)
        self.is_recorded = str(gap) == "recording"
        decider = gap_decider("critical_gap" if self.is_recorded else gap)
        self.policy = _core.Policy(decider.text(), str(gap))
        self.core = _core.Replay(
            self.intersection.core,
            self.policy,
            self.is_recorded,
            self.tracks.arrays,
            self.tracks.actors,
            worlds,
            autoreset,
            threads,
            isa,
        )
        self._bind("action", "observation", "final_observation", "reward", "terminated", "truncated")
        self._bind("expert_observation", "expert_acceleration", "track", "time")

    def start(self, world: int, track: int) -> None:
        """Begins one world's episode with this track, at its first recorded step."""
        self.core.start(world, track)
        self.is_reset = True


def fresh_seed() -> int:
    """A seed that nobody knows beforehand, for a first reset without one."""
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0] >> 1)


def gap_decider(gap: str | Path) -> PolicyFile:
    """Who decides about gaps: a rule's name, or a policy (name or file) with a gap network.

    Raises:
        ValueError: neither.
        OSError: the policy file cannot be read.
    """
    if str(gap) in RULES:
        return PolicyFile(str(gap), "idm")
    try:
        policy = Predictor.load(gap).policy
    except ValueError as error:
        raise ValueError(f"gap: neither {' nor '.join(RULES)}, nor a policy: {error}") from None
    if policy.gap != "network":
        raise ValueError(f'gap: the policy "{gap}" has no gap network; the rules are {", ".join(RULES)}')
    return policy
