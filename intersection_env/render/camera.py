"""Which part of the map a picture shows, and where in it a point of the map lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection
from intersection_env.maps.outline import extent, inside

VIEW = 60.0  # [m], ours: shows the junction and most of what is still decided there
BORDER = 6.0  # [m] shown beside the outermost points of a whole map
COMMON_SIZE = 600  # [pixel], a picture for which strokes and letters have their nominal size
LEAST_STROKE = 0.5  # [pixel/nominal pixel]
LETTERED = 240  # [pixel], smallest picture with room for letters


@dataclass(frozen=True)
class Camera:
    """A look from above, north up."""

    width: int
    height: int
    """Of the picture [pixel]."""
    scale: float
    """[pixel/m]"""
    x: float
    y: float
    """The point of the map at the picture's centre [m]."""

    @classmethod
    def on(cls, intersection: Intersection, size: tuple[int, int], view: float | None) -> Camera:
        """A camera that shows `view` metres around the junction's centre, or the whole map (None).

        Args:
            size: width and height of the picture [pixel].
            view: from the centre to the nearer borders of the picture [m].

        Raises:
            ValueError: a size below 1 pixel, or a view that is not above 0.
        """
        width, height = size
        if min(size) < 1:
            raise ValueError(f"size is {size}; a picture needs at least 1 x 1 pixel")
        if view is not None and not (np.isfinite(view) and view > 0.0):
            raise ValueError(f"view is {view} m; wanted more than 0 m, or None for the whole map")
        if view is None:
            shown = extent(route.samples for route in intersection.routes)
            scale = float(np.min(size / (np.ptp(shown, axis=0) + 2.0 * BORDER)))
        else:
            shown = extent(inside(intersection, route) for route in intersection.routes)
            scale = min(width, height) / (2.0 * view)
        x, y = shown.mean(axis=0).tolist()
        return cls(width, height, scale, x, y)

    @property
    def stroke(self) -> float:
        """How many pixels a stroke of nominally one pixel has; larger pictures have wider ones."""
        return max(LEAST_STROKE, min(self.width, self.height) / COMMON_SIZE)

    @property
    def letter(self) -> float:
        """How many pixels a letter of nominally one pixel has; they stay readable in smaller pictures."""
        return max(1.0, self.stroke)

    @property
    def has_letters(self) -> bool:
        """Whether the picture is large enough for letters and scales."""
        return min(self.width, self.height) >= LETTERED

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """The part of the map that is shown: least x, least y, greatest x, greatest y [m]."""
        half_x, half_y = 0.5 * self.width / self.scale, 0.5 * self.height / self.scale
        return self.x - half_x, self.y - half_y, self.x + half_x, self.y + half_y

    def pixels(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Where points of the map (..., 2) [m] lie in the picture, from its upper left corner [pixel]."""
        place = (points - np.array((self.x, self.y))) * (self.scale, -self.scale)
        return np.asarray(place + 0.5 * np.array((self.width, self.height)), dtype=np.float64)
