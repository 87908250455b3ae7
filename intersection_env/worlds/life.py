"""The batched worlds: thousands of simulated intersections, stepped at once on buffers that the core owns.

Every array named here is a view of the core's memory, valid as long as the worlds are: write `action`, call `step()`,
read the others, and copy what is to outlive the next step. `ClosedLoop` and `Replay` are views of one such world.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import check_seed, word
from intersection_env.worlds.state import check_state

Autoreset = Literal["off", "same_step", "next_step"]
Bodies = Literal["circles", "rectangles"]


class Worlds:
    """What both kinds of worlds share: their life from reset to reset, and their state."""

    core: _core.ClosedLoop | _core.Replay
    action: NDArray[np.float32]
    observation: NDArray[np.float32]
    final_observation: NDArray[np.float32]
    reward: NDArray[np.float32]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    def __init__(self, arguments: dict[str, Any]) -> None:
        for name, known in (("autoreset", Autoreset), ("bodies", Bodies)):
            word(name, arguments[name], get_args(known))
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

    def reset_each(self, seeds: Sequence[int | None], mask: NDArray[np.bool_] | None = None) -> None:
        """Starts each world as the only one of worlds that `reset(seeds[world])` starts; None: its stream goes on.

        mask: (world,) bool, which worlds to start; None: all.

        Raises:
            TypeError, ValueError: not one seed a world, or one that is no whole number from 0 to 2^63 - 1.
            RuntimeError: there is no room on the map for so many vehicles, or not all worlds are to start first.
        """
        worlds = len(self.action)
        if len(seeds) != worlds:
            raise ValueError(f"there are {len(seeds)} seeds; wanted one for each of the {worlds} worlds")
        checked = [None if seed is None else check_seed(seed) for seed in seeds]
        mask = np.ones(worlds, np.bool_) if mask is None else mask
        if not self.is_reset:
            if not mask.all():
                raise RuntimeError("the first reset must start all worlds")
            self.reset(fresh_seed())
        elif (on := mask & [seed is None for seed in checked]).any():
            self.core.reset_worlds(on)
        alone = self._made(1)
        state = self.state()
        for world in np.flatnonzero(mask).tolist():
            if (seed := checked[world]) is not None:
                alone.reset(seed, False)
                for name, values in alone.state().items():
                    state[name][world] = values[0]
        self.core.set_state(state)

    def _made(self, worlds: int) -> _core.ClosedLoop | _core.Replay:
        """The core's worlds, so many, with the arguments of these."""
        raise NotImplementedError

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


def _restored(kind: type[Worlds], arguments: dict[str, Any], state: dict[str, NDArray[Any]] | None) -> Worlds:
    worlds = kind(**arguments)
    if state is not None:
        worlds.set_state(state)
    return worlds


def fresh_seed() -> int:
    """A seed that nobody knows beforehand, for a first reset without one."""
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0] >> 1)
