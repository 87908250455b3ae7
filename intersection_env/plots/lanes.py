"""The lanes of a map: the ground on which plots draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from intersection_env.maps.intersection import Intersection
from intersection_env.maps.outline import along, band, junction_extent, marked, pavement, polygons
from intersection_env.plots.colours import ASPHALT, KERB

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_lanes(axes: Axes, intersection: Intersection) -> None:
    """Draws the lanes of all routes as one paved surface, with their borders outside the junction."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    paved = pavement(along(intersection, route, 0.0, route.length) for route in intersection.routes)
    rings = [ring for part in polygons(paved) for ring in (part.exterior, *part.interiors)]
    outline = Path.make_compound_path(*(Path(np.asarray(ring.coords), closed=True) for ring in rings))
    axes.add_patch(PathPatch(outline, facecolor=ASPHALT, edgecolor="none", zorder=1.0))
    for route in intersection.routes:
        for begin, end in marked(route):
            for border in np.split(band(along(intersection, route, begin, end)), 2):
                axes.plot(*border.T, color="white", linewidth=0.7, zorder=1.1)
    axes.add_patch(PathPatch(outline, facecolor="none", edgecolor=KERB, linewidth=0.9, zorder=1.2))


def zoom_to_junction(axes: Axes, intersection: Intersection, margin: float = 0.0) -> None:
    """Shows the junction, a little of each arm and `margin` metres around, at equal scales."""
    (left, low), (right, high) = junction_extent(intersection).tolist()
    axes.set_xlim(left - margin, right + margin)
    axes.set_ylim(low - margin, high + margin)
    axes.set_aspect("equal")
