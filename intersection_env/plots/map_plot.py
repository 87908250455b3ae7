"""Pictures of a map, and of its routes' meeting places.

python -m intersection_env.plots bendplatz --out bendplatz.png
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection, Route, Sample
from intersection_env.maps.meeting import SWEPT_WIDTH, Conflict
from intersection_env.plots.files import SUFFIXES, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARM_COLOURS = ("#2f6da8", "#b5483a", "#2f8257", "#7b5aa6", "#8a6d3b", "#4f5b66")
CROSSING, MERGING = "#e69a2e", "#5aa7b8"
ASPHALT, KERB, INK = "#e9e9e7", "#c4c4c0", "#2b2b2b"
MARGIN = 11.0  # [m] of each arm that is shown before and after the junction
BORDER = 8.0  # [m] shown beside the arms
CLOSED_GAP = 0.8  # [m], half the widest sliver between lanes that is drawn as paved
BAR = 2.4  # [m], longest stop line drawn: those of one lane part where its routes already turn


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
    _draw_arm_labels(axes, intersection)
    _draw_route_labels(axes, intersection)
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


def arm_colours(intersection: Intersection) -> dict[str, str]:
    """One colour for each arm from which routes come."""
    arms = dict.fromkeys(route.id.partition("-")[0] for route in intersection.routes)
    return {arm: ARM_COLOURS[number % len(ARM_COLOURS)] for number, arm in enumerate(arms)}


def route_colour(intersection: Intersection, route: int) -> str:
    """The colour of the arm from which a route comes."""
    return arm_colours(intersection)[intersection.routes[route].id.partition("-")[0]]


def draw_lanes(axes: Axes, intersection: Intersection) -> None:
    """Draws the lanes of all routes as one paved surface, with their borders outside the junction."""
    import shapely
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    bands = [shapely.Polygon(_band(intersection, route.index, 0.0, route.length)) for route in intersection.routes]
    paved = shapely.union_all([shapely.make_valid(band) for band in bands])
    paved = paved.buffer(CLOSED_GAP).buffer(-CLOSED_GAP)
    rings = [ring for part in shapely.get_parts(paved) for ring in (part.exterior, *part.interiors)]
    outline = Outline.make_compound_path(*(Outline(np.asarray(ring.coords), closed=True) for ring in rings))
    axes.add_patch(PathPatch(outline, facecolor=ASPHALT, edgecolor="none", zorder=1.0))
    for route in intersection.routes:
        for begin, end in ((0.0, route.junction[0] - 2.0), (route.junction[1] + 2.0, route.length)):
            for side in np.split(_band(intersection, route.index, begin, end), 2):
                axes.plot(*side.T, color="white", linewidth=0.7, zorder=1.1)
    axes.add_patch(PathPatch(outline, facecolor="none", edgecolor=KERB, linewidth=0.9, zorder=1.2))


def zoom_to_junction(axes: Axes, intersection: Intersection) -> None:
    """Shows the junction and a little of each arm, at equal scales."""
    (left, low), (right, high) = junction_extent(intersection).tolist()
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")


def junction_extent(intersection: Intersection) -> NDArray[np.float64]:
    """The lower left and upper right corner of the junction and a little of each arm: (2, 2) [m]."""
    ends = [
        _along(intersection, route, max(route.junction[0] - MARGIN, 0.0), min(route.junction[1] + MARGIN, route.length))
        for route in intersection.routes
    ]
    points = np.concatenate(ends)[:, :2].astype(np.float64)
    return np.stack([points.min(axis=0) - BORDER, points.max(axis=0) + BORDER])


def _along(intersection: Intersection, route: Route, begin: float, end: float) -> NDArray[np.float32]:
    """The samples of a route from arc length `begin` to `end` [m], half a metre or less apart."""
    count = max(2, int(np.ceil((end - begin) / 0.5)) + 1)
    return intersection.sample(route.index, np.linspace(begin, end, count, dtype=np.float32))


def _band(
    intersection: Intersection, route: int, begin: float, end: float, width: float | None = None
) -> NDArray[np.float32]:
    """The outline of a stretch of a route, as wide as its lane by default: (point, 2) [m]."""
    samples = _along(intersection, intersection.routes[route], begin, end)
    half = 0.5 * (samples[:, [Sample.WIDTH]] if width is None else np.full((len(samples), 1), width, np.float32))
    left = np.stack([-np.sin(samples[:, Sample.HEADING]), np.cos(samples[:, Sample.HEADING])], axis=1)
    return np.concatenate([samples[:, :2] + half * left, (samples[:, :2] - half * left)[::-1]])


def _draw_routes(axes: Axes, intersection: Intersection) -> None:
    for route in intersection.routes:
        colour = route_colour(intersection, route.index)
        approach = _along(intersection, route, 0.0, route.junction[1])
        axes.plot(*approach[:, :2].T, color=colour, linewidth=1.1, zorder=3.0, solid_capstyle="butt")
        leaving = _along(intersection, route, route.junction[1], route.length)
        axes.plot(*leaving[:, :2].T, color="#8c8c88", linewidth=0.9, zorder=2.9, solid_capstyle="butt")
        shown = (
            (route.junction[0] - 0.7 * MARGIN, colour),
            (route.junction[0] - 0.25 * MARGIN, colour),
            (route.junction[1] + 0.3 * MARGIN, "#8c8c88"),
            (route.junction[1] + 0.75 * MARGIN, "#8c8c88"),
        )
        for position, own in shown:
            _draw_arrow(axes, intersection, route, position, own)


def _draw_arrow(axes: Axes, intersection: Intersection, route: Route, position: float, colour: str) -> None:
    tail, head = _along(intersection, route, position - 0.6, position + 0.6)[[0, -1], :2]
    arrow = {"arrowstyle": "-|>,head_length=0.35,head_width=0.2", "color": colour, "linewidth": 0.0}
    axes.annotate("", xy=(head[0], head[1]), xytext=(tail[0], tail[1]), arrowprops=arrow, zorder=3.1)


def _draw_conflicts(axes: Axes, intersection: Intersection) -> None:
    for conflict in intersection.conflicts:
        colour = MERGING if conflict.merging else CROSSING
        for outline in _overlap(intersection, conflict):
            axes.fill(*outline.T, facecolor=colour, alpha=0.32, linewidth=0.0, zorder=2.0)
            axes.fill(*outline.T, facecolor="none", edgecolor=colour, linewidth=0.6, zorder=2.1)
        (x, y, *_), *_ = intersection.sample(conflict.yielder, np.array([conflict.on_yielder[1]], np.float32))
        axes.plot(x, y, marker="D", markersize=3.4, color=colour, markeredgecolor=INK, markeredgewidth=0.5, zorder=4.0)


def _overlap(intersection: Intersection, conflict: Conflict) -> Iterator[NDArray[np.float64]]:
    """The outlines of what both routes of a conflict sweep: each (point, 2) [m]."""
    import shapely

    one, other = (
        shapely.make_valid(shapely.Polygon(_band(intersection, route, *interval, SWEPT_WIDTH)))
        for route, interval in (
            (conflict.yielder, conflict.on_yielder),
            (conflict.prioritized, conflict.on_prioritized),
        )
    )
    for part in shapely.get_parts(one.intersection(other)):
        if isinstance(part, shapely.Polygon):
            yield np.asarray(part.exterior.coords)


def _draw_stop_lines(axes: Axes, intersection: Intersection) -> None:
    yielding = {conflict.yielder for conflict in intersection.conflicts}
    for route in intersection.routes:
        x, y, heading, width = intersection.sample(route.index, np.array([route.stop_line], np.float32))[0, :4]
        across = 0.5 * min(width, BAR) * np.array([-np.sin(heading), np.cos(heading)])
        must_yield = route.index in yielding
        axes.plot(
            [x - across[0], x + across[0]],
            [y - across[1], y + across[1]],
            color=INK if must_yield else "#8c8c88",
            linewidth=2.2 if must_yield else 1.0,
            linestyle="-" if must_yield else (0, (2.0, 1.2)),
            solid_capstyle="butt",
            zorder=3.6 if must_yield else 3.5,
        )


def _draw_arm_labels(axes: Axes, intersection: Intersection) -> None:
    """Names each arm at the side of its approach, with the routes of each lane in one line."""
    colours = arm_colours(intersection)
    for arm, colour in colours.items():
        routes = [route for route in intersection.routes if route.id.partition("-")[0] == arm]
        lanes: dict[int, list[str]] = {}
        for route in routes:
            lanes.setdefault(route.stop_lane, []).append(route.id)
        rightmost = max(routes, key=lambda route: _is_right_of(intersection, route, routes[0]))
        x, y, heading, width = _along(intersection, rightmost, rightmost.junction[0] - 6.0, rightmost.length)[0, :4]
        right = np.array([np.sin(heading), -np.cos(heading)])
        place_x, place_y = (x, y) + (0.5 * width + 2.5) * right
        text = "\n".join([f"from {arm}", *(", ".join(ids) for ids in lanes.values())])
        axes.text(
            float(place_x),
            float(place_y),
            text,
            color=colour,
            fontsize=8.5,
            linespacing=1.35,
            ha="left" if right[0] > 0.0 else "right",
            va="bottom" if right[1] > 0.0 else "top",
            zorder=5.0,
        )


def _is_right_of(intersection: Intersection, route: Route, other: Route) -> float:
    """How far a route's stop line lies to the right of another's [m]."""
    x, y = intersection.sample(route.index, np.array([route.junction[0]], np.float32))[0, :2]
    x0, y0, heading = intersection.sample(other.index, np.array([other.junction[0]], np.float32))[0, :3]
    return float((x - x0) * np.sin(heading) - (y - y0) * np.cos(heading))


def _draw_route_labels(axes: Axes, intersection: Intersection) -> None:
    """Writes each route's id where it runs farthest from the others and from the ids before."""
    from matplotlib.patheffects import withStroke

    inside = [_along(intersection, route, *route.junction)[:, :2] for route in intersection.routes]
    taken: list[NDArray[np.float32]] = []
    for route, own in zip(intersection.routes, inside, strict=True):
        others = np.concatenate([points for points in inside if points is not own])
        clear = np.linalg.norm(own[:, None] - others[None], axis=2).min(axis=1)
        for place in taken:
            clear = np.minimum(clear, 0.35 * np.linalg.norm(own - place, axis=1))
        place = own[int(np.argmax(clear))]
        taken.append(place)
        axes.text(
            float(place[0]),
            float(place[1]),
            route.id,
            color=route_colour(intersection, route.index),
            fontsize=6.5,
            ha="center",
            va="center",
            zorder=5.0,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )


def _draw_legend(axes: Axes) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    diamond: dict[str, Any] = {"marker": "D", "markersize": 4, "markeredgecolor": INK, "linewidth": 0.0}
    entries = [
        Patch(facecolor=ASPHALT, edgecolor=KERB, label="lane"),
        Line2D([], [], color=INK, linewidth=2.2, label="stop line, has to yield"),
        Line2D([], [], color="#8c8c88", linewidth=1.0, linestyle=(0, (2.0, 1.2)), label="stop line, has priority"),
        Patch(facecolor=CROSSING, alpha=0.5, label="crossing conflict"),
        Patch(facecolor=MERGING, alpha=0.5, label="merging conflict"),
        Line2D([], [], color="white", **diamond, label="PGA of the one that yields"),
    ]
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 5.0}
    axes.legend(handles=entries, **place, ncols=3, fontsize=8, frameon=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draws a map into a file and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m intersection_env.plots", description="Draws a map.")
    parser.add_argument("map", help="a shipped map's name, or the path of a .json (source) or .map (compiled)")
    parser.add_argument("--out", type=Path, required=True, help=f"the file to write ({', '.join(SUFFIXES)})")
    options = parser.parse_args(arguments)
    try:
        axes = plot_map(Intersection.load(options.map))
        figure: Any = axes.figure
        write_figure(figure, options.out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written: {options.out}")
    return 0
