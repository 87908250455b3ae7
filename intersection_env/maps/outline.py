"""The road as it is seen from above: what every picture of a map draws, on whatever canvas.

Everything is in metres on the map, and as precise as the samples that a shape is made from. Only functions that unite
or cut areas load shapely.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from intersection_env.maps.intersection import XY, Intersection, Route, Sample
from intersection_env.maps.meeting import SWEPT_WIDTH, Conflict

if TYPE_CHECKING:
    import shapely
    from shapely.geometry.base import BaseGeometry

FINE = 0.5  # [m], ours: between samples that are to look smooth on paper
UNMARKED = 2.0  # [m] beside the junction where lanes have no borders
CLOSED_GAP = 0.8  # [m], half the widest sliver between lanes that is drawn as paved
SAME_LINE = 2.0  # [m] between stop lines of one lane that are painted as one
ARM_SHOWN = 11.0  # [m] of each arm that belong to the picture of a junction
BESIDE = 8.0  # [m] that are shown beside it

Precision = TypeVar("Precision", bound=np.floating)
Samples = NDArray[Precision]
"""(sample, 11) of a route, columns `Sample`."""
Points = NDArray[np.floating]
"""(point, 2): x and y [m]."""


class StopLine(NamedTuple):
    """A line before which vehicles wait: its left and right end (2, 2) [m], and whether some of them have to yield."""

    ends: Points
    must_yield: bool


def along(intersection: Intersection, route: Route, begin: float, end: float) -> Samples[np.float32]:
    """The route from arc length `begin` to `end` [m], half a metre or less apart."""
    count = max(2, int(np.ceil((end - begin) / FINE)) + 1)
    return intersection.sample(route.index, np.linspace(begin, end, count, dtype=np.float32))


def inside(intersection: Intersection, route: Route) -> Samples[np.float32]:
    """The route's own samples inside its junction, and one before and behind."""
    begin, end = (int(place / intersection.spacing) for place in route.junction)
    return route.samples[begin : end + 2]


def outside(intersection: Intersection, route: Route) -> Iterator[Samples[np.float32]]:
    """The route's own samples where its lane's borders are marked: those of the approach, and those of the exit."""
    (_, approach_end), (exit_begin, _) = marked(route)
    before, behind = int(approach_end / intersection.spacing), int(np.ceil(exit_begin / intersection.spacing))
    for stretch in (route.samples[: max(0, before)], route.samples[behind:]):
        if len(stretch) > 1:
            yield stretch


def marked(route: Route) -> tuple[tuple[float, float], tuple[float, float]]:
    """From where to where the borders of the route's lane are marked on its approach and on its exit: arc lengths."""
    begin, end = route.junction
    return (0.0, begin - UNMARKED), (end + UNMARKED, route.length)


def directions(samples: Samples[Precision]) -> tuple[NDArray[Precision], NDArray[Precision]]:
    """Unit vectors ahead and to the left at each sample: (sample, 2) each."""
    heading = samples[:, Sample.HEADING]
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return ahead, np.stack([-np.sin(heading), np.cos(heading)], axis=1)


def sides(samples: Samples[Precision], width: float | None = None) -> tuple[NDArray[Precision], NDArray[Precision]]:
    """The left and the right border of a lane, or of a band of a certain width [m]: (sample, 2) [m] each."""
    _, left = directions(samples)
    half = 0.5 * (samples[:, [Sample.WIDTH]] if width is None else width)
    return samples[:, XY] + half * left, samples[:, XY] - half * left


def band(samples: Samples[Precision], width: float | None = None) -> NDArray[Precision]:
    """The same as one outline: up the left side and back down the right one."""
    left, right = sides(samples, width)
    return np.concatenate([left, right[::-1]])


def extent(parts: Iterable[Samples[np.floating]]) -> NDArray[np.float64]:
    """The lower left and the upper right corner of all these samples: (2, 2) [m]."""
    points = np.concatenate([samples[:, XY] for samples in parts]).astype(np.float64)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def junction_extent(intersection: Intersection) -> NDArray[np.float64]:
    """The lower left and upper right corner of the junction and a little of each arm: (2, 2) [m]."""
    shown = []
    for route in intersection.routes:
        begin, end = route.junction
        shown.append(along(intersection, route, max(begin - ARM_SHOWN, 0.0), min(end + ARM_SHOWN, route.length)))
    low, high = extent(shown)
    return np.stack([low - BESIDE, high + BESIDE])


def stop_lines(intersection: Intersection, longest: float) -> Iterator[StopLine]:
    """The stop line of each route, across it, as long as its lane is wide or at most `longest` [m]."""
    yielding = _yielding(intersection)
    for route in intersection.routes:
        yield StopLine(_across(intersection, route, route.stop_line, longest), route.index in yielding)


def painted_stop_lines(intersection: Intersection, longest: float) -> Iterator[StopLine]:
    """The stop lines of each lane, at most `longest` [m], across the approach even where a route already turns.

    Where routes of one lane stop at about the same place they share one line.
    """
    yielding = _yielding(intersection)
    lanes: dict[int, list[list[Route]]] = {}
    for route in sorted(intersection.routes, key=lambda route: route.stop_line):
        lines = lanes.setdefault(route.stop_lane, [])
        if lines and route.stop_line - lines[-1][0].stop_line < SAME_LINE:
            lines[-1].append(route)
        else:
            lines.append([route])
    for routes in (routes for lines in lanes.values() for routes in lines):
        ends = [_across(intersection, route, route.junction[0], longest) for route in routes]
        yield StopLine(np.mean(ends, axis=0), any(route.index in yielding for route in routes))


def pavement(lanes: Iterable[Samples[np.floating]], exact: float | None = None) -> BaseGeometry:
    """The area that lanes, given by their samples, cover; slivers between them are closed.

    exact: by how much a border may differ to have fewer corners [m].
    """
    import shapely

    area = shapely.union_all([_area(band(samples)) for samples in lanes])
    area = area if exact is None else area.simplify(exact)
    return area.buffer(CLOSED_GAP).buffer(-CLOSED_GAP)


def conflict_areas(intersection: Intersection, conflict: Conflict) -> list[Points]:
    """The outlines of what vehicles of both routes of a conflict sweep."""
    swept = (
        _area(band(along(intersection, intersection.routes[route], *interval), SWEPT_WIDTH))
        for route, interval in (
            (conflict.yielder, conflict.on_yielder),
            (conflict.prioritized, conflict.on_prioritized),
        )
    )
    one, other = swept
    return [np.asarray(part.exterior.coords) for part in polygons(one.intersection(other))]


def polygons(area: BaseGeometry) -> list[shapely.Polygon]:
    """The parts of an area, without the points and lines that cutting may leave."""
    import shapely

    parts = shapely.get_parts(area).tolist()
    return [part for part in parts if isinstance(part, shapely.Polygon) and not part.is_empty]


def _area(outline: Points) -> BaseGeometry:
    import shapely

    return shapely.make_valid(shapely.Polygon(outline))


def _yielding(intersection: Intersection) -> set[int]:
    """The indices of the routes that have to yield to another one."""
    return {conflict.yielder for conflict in intersection.conflicts}


def _across(intersection: Intersection, route: Route, direction_at: float, longest: float) -> Points:
    """The left and right end of a line at a route's stop line, across its direction at another place: (2, 2) [m]."""
    places = np.array([route.stop_line, direction_at], np.float32)
    line, there = np.split(intersection.sample(route.index, places), 2)
    line[:, Sample.HEADING] = there[:, Sample.HEADING]
    line[:, Sample.WIDTH] = np.minimum(line[:, Sample.WIDTH], longest)
    return np.concatenate(sides(line))
