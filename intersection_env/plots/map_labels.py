"""What is written onto the plot of a map: the names of its arms and routes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import XY, Intersection, Route, Sample
from intersection_env.maps.outline import along, directions
from intersection_env.plots.colours import arm_colours, route_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BEFORE_JUNCTION, BESIDE_LANE = 6.0, 2.5  # [m], where the name of an arm begins
MOST_IN_A_LINE = 3  # routes that are named in one line; more would reach over the picture's border


def draw_arm_labels(axes: Axes, intersection: Intersection) -> None:
    """Names each arm at the side of its approach, with the routes of each lane in lines of their own."""
    for arm, colour in arm_colours(intersection).items():
        routes = [route for route in intersection.routes if route.entry == arm]
        lanes: dict[int, list[str]] = {}
        for route in routes:
            lanes.setdefault(route.stop_lane, []).append(route.id)
        rightmost = routes[int(np.argmax(_to_the_right(intersection, routes)))]
        at = intersection.sample(rightmost.index, np.array([rightmost.junction[0] - BEFORE_JUNCTION], np.float32))
        _, (left,) = directions(at)
        right = -left
        east, north = right
        x, y = (at[0, XY] + (0.5 * at[0, Sample.WIDTH] + BESIDE_LANE) * right).tolist()
        axes.text(
            x,
            y,
            "\n".join([f"from {arm}", *(", ".join(ids) for lane in lanes.values() for ids in _lines(lane))]),
            color=colour,
            fontsize=8.5,
            linespacing=1.35,
            ha="left" if east > 0.0 else "right",
            va="bottom" if north > 0.0 else "top",
            zorder=5.0,
        )


def _lines(ids: list[str]) -> list[list[str]]:
    """A lane's routes in lines that stay beside its arm: one, or two of the same length."""
    middle = len(ids) if len(ids) <= MOST_IN_A_LINE else (len(ids) + 1) // 2
    return [line for line in (ids[:middle], ids[middle:]) if line]


def _to_the_right(intersection: Intersection, routes: list[Route]) -> NDArray[np.float64]:
    """How far each route enters the junction to the right of the first: (route,) [m]."""
    begins = np.array([route.junction[0] for route in routes], np.float32)
    samples = intersection.sample_each(np.array([route.index for route in routes]), begins)
    _, (left,) = directions(samples[:1])
    return np.asarray(-(samples[:, XY] - samples[0, XY]) @ left)


def draw_route_labels(axes: Axes, intersection: Intersection) -> None:
    """Writes each route's id where it runs farthest from the others and from the ids before."""
    from matplotlib.patheffects import withStroke

    centrelines = [along(intersection, route, *route.junction)[:, XY] for route in intersection.routes]
    taken: list[NDArray[np.float32]] = []
    for route, own in zip(intersection.routes, centrelines, strict=True):
        others = np.concatenate([points for points in centrelines if points is not own])
        clear = np.linalg.norm(own[:, None] - others[None], axis=2).min(axis=1)
        for place in taken:
            clear = np.minimum(clear, 0.35 * np.linalg.norm(own - place, axis=1))
        taken.append(own[int(np.argmax(clear))])
        x, y = taken[-1].tolist()
        axes.text(
            x,
            y,
            route.id,
            color=route_colour(intersection, route.index),
            fontsize=6.5,
            ha="center",
            va="center",
            zorder=5.0,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )
