"""Pictures of a map, and of its routes' meeting places.

python -m intersection_env.plots bendplatz --out bendplatz.png
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from intersection_env.maps.intersection import XY, Intersection, Route
from intersection_env.maps.outline import ARM_SHOWN, along, conflict_areas, junction_extent, stop_lines
from intersection_env.plots.colours import ASPHALT, CROSSING, GREY, INK, KERB, MERGING, route_colour
from intersection_env.plots.lanes import draw_lanes, zoom_to_junction
from intersection_env.plots.map_labels import draw_arm_labels, draw_route_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LONGEST_LINE = 2.4  # [m], of stop lines: those of one lane part where its routes already turn
WAITING: dict[str, Any] = {"color": INK, "linewidth": 2.2, "linestyle": "-"}
PASSING: dict[str, Any] = {"color": GREY, "linewidth": 1.0, "linestyle": (0, (2.0, 1.2))}


def plot_map(intersection: Intersection, axes: Axes | None = None) -> Axes:
    """Draws a map so that a person can check it: lanes, routes, stop lines, conflict areas and PGAs.

    Args:
        intersection: the map.
        axes: where to draw; by default a figure of its own, `axes.figure`.
    """
    if axes is None:
        from matplotlib.figure import Figure

        width, height = np.ptp(junction_extent(intersection), axis=0)
        size = 6.6 / max(width, height)
        axes = Figure(figsize=(size * width + 0.8, size * height + 1.4), layout="constrained").add_subplot()
    draw_lanes(axes, intersection)
    _draw_conflicts(axes, intersection)
    _draw_routes(axes, intersection)
    _draw_stop_lines(axes, intersection)
    zoom_to_junction(axes, intersection)
    draw_arm_labels(axes, intersection)
    draw_route_labels(axes, intersection)
    merging = sum(conflict.merging for conflict in intersection.conflicts)
    axes.set_title(
        f"{intersection.name}: {len(intersection.routes)} routes,"
        f" {len(intersection.conflicts) - merging} crossing and {merging} merging conflicts",
        fontsize=11,
    )
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.tick_params(labelsize=8)
    _draw_legend(axes)
    return axes


def _draw_conflicts(axes: Axes, intersection: Intersection) -> None:
    for conflict in intersection.conflicts:
        colour = MERGING if conflict.merging else CROSSING
        for outline in conflict_areas(intersection, conflict):
            axes.fill(*outline.T, facecolor=colour, alpha=0.32, linewidth=0.0, zorder=2.0)
            axes.fill(*outline.T, facecolor="none", edgecolor=colour, linewidth=0.6, zorder=2.1)
        pga = intersection.sample(conflict.yielder, np.array([conflict.on_yielder[1]], np.float32))[0, XY]
        edge: dict[str, Any] = {"markeredgecolor": INK, "markeredgewidth": 0.5}
        axes.plot(*pga, marker="D", markersize=3.4, color=colour, **edge, zorder=4.0)


def _draw_routes(axes: Axes, intersection: Intersection) -> None:
    for route in intersection.routes:
        colour = route_colour(intersection, route.index)
        begin, end = route.junction
        until_left = along(intersection, route, 0.0, end)
        axes.plot(*until_left[:, XY].T, color=colour, linewidth=1.1, zorder=3.0, solid_capstyle="butt")
        leaving = along(intersection, route, end, route.length)
        axes.plot(*leaving[:, XY].T, color=GREY, linewidth=0.9, zorder=2.9, solid_capstyle="butt")
        for share in (0.7, 0.25):
            _draw_arrow(axes, intersection, route, begin - share * ARM_SHOWN, colour)
        for share in (0.3, 0.75):
            _draw_arrow(axes, intersection, route, end + share * ARM_SHOWN, GREY)


def _draw_arrow(axes: Axes, intersection: Intersection, route: Route, position: float, colour: str) -> None:
    ends = np.array([position - 0.6, position + 0.6], np.float32)
    tail, head = intersection.sample(route.index, ends)[:, XY]
    arrow = {"arrowstyle": "-|>,head_length=0.35,head_width=0.2", "color": colour, "linewidth": 0.0}
    axes.annotate("", xy=tuple(head), xytext=tuple(tail), arrowprops=arrow, zorder=3.1)


def _draw_stop_lines(axes: Axes, intersection: Intersection) -> None:
    for line in stop_lines(intersection, LONGEST_LINE):
        style, above = (WAITING, 3.6) if line.must_yield else (PASSING, 3.5)
        axes.plot(*line.ends[::-1].T, **style, solid_capstyle="butt", zorder=above)


def _draw_legend(axes: Axes) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    diamond: dict[str, Any] = {"marker": "D", "markersize": 4, "markeredgecolor": INK, "linewidth": 0.0}
    entries = [
        Patch(facecolor=ASPHALT, edgecolor=KERB, label="lane"),
        Line2D([], [], **WAITING, label="stop line, has to yield"),
        Line2D([], [], **PASSING, label="stop line, has priority"),
        Patch(facecolor=CROSSING, alpha=0.5, label="crossing conflict"),
        Patch(facecolor=MERGING, alpha=0.5, label="merging conflict"),
        Line2D([], [], color="white", **diamond, label="PGA of the one that yields"),
    ]
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 5.0}
    axes.legend(handles=entries, **place, ncols=3, fontsize=8, frameon=False)
