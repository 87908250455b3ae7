"""A map as the page draws it: what is paved, its lines, and where along each route is what."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intersection_env.maps.intersection import Intersection, Route, Sample
from intersection_env.maps.outline import (
    along,
    conflict_areas,
    junction_extent,
    outside,
    painted_stop_lines,
    pavement,
    polygons,
    sides,
)

EXACT = 0.02  # [m], to which borders of the road are drawn
LONGEST_LINE = 2.8  # [m], of stop lines


def rounded(values: ArrayLike, decimals: int = 2) -> Any:
    """Numbers as lists, short enough to send: on the ground and along routes a centimetre is enough."""
    return np.round(np.asarray(values, np.float64), decimals).tolist()


def road_of(intersection: Intersection) -> dict[str, Any]:
    """Everything about a map that stands still.

    `routes` say, by arc length [m], where the stop line and the first conflict are, and where the route runs: `x`, `y`
    [m] and `heading` [rad, unwrapped] every `spacing` metres. `arms` are in the order in which they get colours.
    """
    arms = list(dict.fromkeys(route.entry for route in intersection.routes))
    paved = pavement((along(intersection, route, 0.0, route.length) for route in intersection.routes), EXACT)
    borders = (
        side
        for route in intersection.routes
        for stretch in outside(intersection, route)
        for side in sides(stretch.astype(np.float64))
    )
    return {
        "name": intersection.name,
        "arms": arms,
        "spacing": intersection.spacing,
        "extent": rounded(junction_extent(intersection)),
        "paved": [[rounded(ring.coords) for ring in (part.exterior, *part.interiors)] for part in polygons(paved)],
        "borders": [rounded(line) for line in borders],
        "stopLines": [
            {"ends": rounded(line.ends), "mustYield": line.must_yield}
            for line in painted_stop_lines(intersection, LONGEST_LINE)
        ],
        "conflicts": [
            rounded(outline) for one in intersection.conflicts for outline in conflict_areas(intersection, one)
        ],
        "routes": [_route(route, arms) for route in intersection.routes],
    }


def _route(route: Route, arms: list[str]) -> dict[str, Any]:
    samples = route.samples
    return {
        "id": route.id,
        "arm": arms.index(route.entry),
        "length": round(route.length, 2),
        "stopLine": round(route.stop_line, 2),
        "mustStop": route.must_stop,
        "line": round(route.first_conflict if route.first_conflict < route.length else route.stop_line, 2),
        "x": rounded(samples[:, Sample.X]),
        "y": rounded(samples[:, Sample.Y]),
        "heading": rounded(samples[:, Sample.HEADING], 4),
        "limit": rounded(samples[:, Sample.V_MAX]),
    }
