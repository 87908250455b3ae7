"""Pictures of traffic, for people and for videos, drawn with pygame."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection
from intersection_env.render.camera import VIEW, Camera
from intersection_env.render.snapshot import Snapshot

if TYPE_CHECKING:
    import pygame


class Renderer:
    """Draws snapshots on one map, which is drawn once.

    Bodies are to scale; their colour is the speed, a dark bar the windscreen; a red bar stands before one that is
    held (delta = 0). A red arrow leads from one that waits to whom it waits for, a dashed violet one from the second
    to the first of a priority assignment. Pictures below 240 pixels carry no letters.
    """

    def __init__(
        self, intersection: Intersection, size: tuple[int, int] = (600, 600), view: float | None = VIEW
    ) -> None:
        """A renderer for pictures of `size`, width and height [pixel].

        Args:
            view: how much is shown around the junction, to the nearer borders [m]; None shows the whole map.

        Raises:
            gymnasium.error.DependencyNotInstalled: there is no pygame.
            ValueError: a size below 1 pixel, or a view that is not above 0.
        """
        self.camera = Camera.on(intersection, size, view)
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it would greet on the standard output
        try:
            import pygame
        except ImportError as error:
            from gymnasium.error import DependencyNotInstalled

            message = 'rendering needs pygame: pip install "intersection_env[render]"'
            raise DependencyNotInstalled(message) from error
        from intersection_env.render.ink import Lettering
        from intersection_env.render.road_layer import still

        self._intersection = intersection
        self._still = still(intersection, self.camera)
        self._pixels = self._still.copy()
        # Shares the array's memory, which spares each picture two conversions.
        self._canvas = pygame.image.frombuffer(self._pixels.data, size, "RGB")
        self._lettering = Lettering(self.camera.letter)
        self._clock: pygame.time.Clock | None = None  # runs while there is a window

    def rgb_array(self, snapshot: Snapshot) -> NDArray[np.uint8]:
        """A picture of a snapshot: (height, width, 3), the caller's own. Needs no display."""
        self._draw(snapshot)
        return self._pixels.copy()

    def show(self, snapshot: Snapshot, fps: float) -> None:
        """Shows a snapshot in a window, which it opens the first time; waits so that `fps` are shown a second."""
        import pygame

        window = pygame.display.get_surface() if pygame.display.get_init() else None
        if window is None or window.get_size() != self._canvas.get_size():
            pygame.display.init()
            window = pygame.display.set_mode(self._canvas.get_size())
            pygame.display.set_caption(f"intersection_env: {self._intersection.name}")
        self._clock = self._clock or pygame.time.Clock()
        self._draw(snapshot)
        window.blit(self._canvas, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(fps)

    def close(self) -> None:
        """Closes the window, if one is open."""
        if self._clock is not None:
            import pygame

            pygame.display.quit()
            self._clock = None

    def _draw(self, snapshot: Snapshot) -> None:
        from intersection_env.render.traffic_layer import draw_snapshot

        np.copyto(self._pixels, self._still)
        draw_snapshot(self._canvas, self._intersection, self.camera, snapshot, self._lettering)
