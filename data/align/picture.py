"""The tracks over a map's lanes, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from data.align.align import Alignment
from data.align.drives import Drive
from intersection_env.maps.intersection import XY, Intersection
from intersection_env.maps.outline import along
from intersection_env.plots.colours import INK, route_colour
from intersection_env.plots.lanes import draw_lanes, zoom_to_junction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARGIN = 14.0  # [m] shown around the junction's picture


def plot_alignment(alignment: Alignment) -> Figure:
    """Two maps side by side: lanes and centrelines, and over them the tracks in the colours of their arms."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 7.8), layout="constrained")
    for axes, title, intersection, drives in zip(
        figure.subplots(1, 2),
        ("before", "after"),
        (alignment.before, alignment.after),
        alignment.drives,
        strict=True,
    ):
        _draw(axes, intersection, drives)
        axes.set_title(f"{intersection.name}, {title}: {len(drives)} cars (dashed: the routes)", fontsize=11)
    return figure


def _draw(axes: Axes, intersection: Intersection, drives: Sequence[Drive]) -> None:
    draw_lanes(axes, intersection)
    for drive in drives:
        axes.plot(*drive.points.T, color=route_colour(intersection, drive.route), linewidth=0.5, alpha=0.6, zorder=2.0)
    for route in intersection.routes:
        line = along(intersection, route, 0.0, route.length)[:, XY]
        axes.plot(*line.T, color=INK, linewidth=0.8, linestyle=(0, (4.0, 3.0)), zorder=3.0)
    zoom_to_junction(axes, intersection, MARGIN)
    axes.tick_params(labelsize=8)
