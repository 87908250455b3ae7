"""Worlds in which every vehicle acts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import whole_number
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.named import gap_decider
from intersection_env.worlds.life import Autoreset, Bodies, Worlds


class ClosedLoopWorlds(Worlds):
    """Worlds in which every vehicle acts; whoever leaves is reinserted.

    Attributes:
        action: (world, vehicle) in [-1, 1], to be written; times 6 m/s². Not checked, unlike in an environment: clip.
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
        bodies: Bodies = "circles",
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
            bodies: what stands for a vehicle in collisions: `"circles"`, the paper's two, or `"rectangles"`, all of it.
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
                "bodies": bodies,
                "autoreset": autoreset,
                "threads": threads,
                "isa": isa,
            }
        )
        self.intersection = map if isinstance(map, Intersection) else Intersection.load(map)
        self.policy = _core.Policy(gap_decider(gap).text(), str(gap))
        self.core = self._made(worlds)
        self._bind("action", "observation", "final_observation", "reward")
        self._bind("terminated", "truncated", "reinserted", "done")

    def _made(self, worlds: int) -> _core.ClosedLoop:
        given = (self._arguments[name] for name in ("vehicles", "max_cycles", "autoreset", "threads", "isa", "bodies"))
        return _core.ClosedLoop(self.intersection.core, self.policy, worlds, *given)
