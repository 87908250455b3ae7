"""What an environment's `render` gives: nothing, pictures, or a window. Needs pygame once something is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds

if TYPE_CHECKING:
    from intersection_env.render.renderer import Renderer

RENDER_MODES = ("human", "rgb_array")
FRAMES_PER_SECOND = 5  # real time


class View:
    """Shows worlds in one render mode. Copies and pickles come without the window."""

    def __init__(self, mode: str | None, modes: tuple[str, ...] = RENDER_MODES) -> None:
        """A view that shows nothing (None), gives pictures ("rgb_array") or has a window ("human").

        Raises:
            ValueError: another mode.
        """
        if mode is not None and mode not in modes:
            raise ValueError(f"render_mode is {mode!r}; wanted None or {' or '.join(map(repr, modes))}")
        self._mode = mode
        self._renderer: Renderer | None = None

    def after_step(self, worlds: ClosedLoopWorlds | ReplayWorlds) -> None:
        """Updates the window, if there is to be one."""
        if self._mode == "human":
            self.show(worlds)

    def show(self, worlds: ClosedLoopWorlds | ReplayWorlds, world: int = 0) -> NDArray[np.uint8] | None:
        """A picture of one world (600, 600, 3), or None after it was shown in the window.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset.
            gymnasium.error.DependencyNotInstalled: there is no pygame.
        """
        if self._mode is None:
            gymnasium.logger.warn("render() without a render_mode: name one when making the environment")
            return None
        if not worlds.is_reset:
            raise ResetNeeded("there is nothing to render before the first reset")
        from intersection_env.render.of_worlds import snapshot_of
        from intersection_env.render.renderer import Renderer

        self._renderer = self._renderer or Renderer(worlds.intersection)
        snapshot = snapshot_of(worlds, world)
        if self._mode == "rgb_array":
            return self._renderer.rgb_array(snapshot)
        self._renderer.show(snapshot, FRAMES_PER_SECOND)
        return None

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {"_mode": self._mode, "_renderer": None}
