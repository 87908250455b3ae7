"""One route of a map source as the core will know it: its centreline, sampled, and its pieces along it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from intersection_env.maps.curve import Points, along
from intersection_env.maps.meeting import SWEPT_WIDTH
from intersection_env.maps.source import MapSource, Piece
from intersection_env.maps.source_entries import STOPPING, RouteSource

SPACING = 1.0  # [m], ours: linear interpolation on this grid is within 2 cm of an arc of 6 m radius
HEADING_OFFSETS = (-10.0, -3.0, 3.0, 10.0, 30.0, 100.0)  # [m], paper, Table I


@dataclass(frozen=True)
class CompiledRoute:
    """One route as the core will know it; arc lengths [m] from the route's start."""

    source: RouteSource
    line: shapely.LineString
    pieces: tuple[str, ...]
    """What its pieces are called: two routes share a piece where both have one of that name."""
    ends: tuple[float, ...]
    """Where each piece ends."""
    samples: NDArray[np.float64]
    """(sample, 11): x, y, heading (unwrapped), lane width, v_max, relative heading at six offsets."""
    stop_line: float
    must_stop: bool
    """Whether who comes along it has to stop before that line."""
    junction: tuple[float, float]

    @property
    def circulates_from(self) -> float:
        """Where its first lane inside the junction begins; where the junction ends if it takes none."""
        if not self.source.interior:
            return self.junction[1]
        return self.ends[self.pieces.index(self.source.interior[0]) - 1]

    @cached_property
    def band(self) -> shapely.Polygon:
        """What a vehicle sweeps along all of it; most pairs of routes are compared by these."""
        return swept(self.line)


def swept(line: shapely.Geometry) -> shapely.Polygon:
    """What a vehicle sweeps along a line."""
    return shapely.buffer(line, SWEPT_WIDTH / 2.0, cap_style="flat")


def compile_route(source: MapSource, route: RouteSource) -> CompiledRoute:
    """The route, sampled.

    Raises:
        ValueError: it does not cross its stop line once.
    """
    pieces = source.pieces(route)
    polyline = np.concatenate([pieces[0].points, *(piece.points[1:] for piece in pieces[1:])])
    line = shapely.LineString(_refine(polyline))
    ends = np.cumsum([shapely.LineString(piece.points).length for piece in pieces])
    inside = [number for number, piece in enumerate(pieces) if piece.inside_junction]
    junction = (float(ends[inside[0] - 1]), float(ends[inside[-1]]))
    stop_line = _stop_line(source, route, line, junction[0])
    widths = np.concatenate([pieces[0].width, *(piece.width[1:] for piece in pieces[1:])])
    samples = _samples(source, route, line, (along(polyline), widths), junction[1])
    must_stop = source.arms[route.entry].right_of_way in STOPPING
    names = tuple(_name(route, pieces, number) for number in range(len(pieces)))
    return CompiledRoute(route, line, names, tuple(ends.tolist()), samples, stop_line, must_stop, junction)


def _name(route: RouteSource, pieces: list[Piece], number: int) -> str:
    """The lane, or between which lanes the curve leads and, where it is drawn for the route alone, for which route."""
    lane = pieces[number].lane
    if lane is not None:
        return lane
    before, after = pieces[number - 1].lane, pieces[number + 1].lane
    drawn = f" of {route.id}" if route.inside is not None and before == route.approach[-1] else ""
    return f"{before} to {after}{drawn}"


def _refine(polyline: Points) -> Points:
    line = shapely.segmentize(shapely.LineString(polyline), 0.25)
    points = shapely.get_coordinates(line)
    return np.asarray(points[np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]])


def _stop_line(source: MapSource, route: RouteSource, line: shapely.LineString, approach_end: float) -> float:
    painted = source.stop_lines.get(route.approach[-1])
    if painted is None:
        return approach_end
    crossing = line.intersection(shapely.LineString(painted))
    if not isinstance(crossing, shapely.Point) or crossing.is_empty:
        raise ValueError(f'route "{route.id}" must cross the stop line of "{route.approach[-1]}" once')
    return float(line.project(crossing))


def _samples(
    source: MapSource,
    route: RouteSource,
    line: shapely.LineString,
    widths: tuple[NDArray[np.float64], NDArray[np.float64]],
    junction_end: float,
) -> NDArray[np.float64]:
    """As `CompiledRoute.samples`; widths: the lane's [m], and at which arc lengths [m]."""
    s = SPACING * np.arange(int(np.ceil(line.length / SPACING)) + 1)
    steps = np.diff(shapely.get_coordinates(line), axis=0)
    length = np.linalg.norm(steps, axis=1)
    middle = np.cumsum(length) - 0.5 * length
    east, north = steps.T
    headings = np.unwrap(np.arctan2(north, east))
    heading = np.interp(s, middle, headings)
    relative = np.stack([np.interp(s + n, middle, headings) - heading for n in HEADING_OFFSETS], axis=1)
    position = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(s, line.length)))
    beyond = np.maximum(s - line.length, 0.0)[:, None]
    position = position + beyond * np.stack([np.cos(headings[-1:]), np.sin(headings[-1:])], axis=1)
    width = np.interp(s, *widths)
    limits = source.arms[route.entry].speed_limit, source.arms[route.exit].speed_limit
    v_max = np.where(s < junction_end, *limits)
    return np.column_stack([position, heading, width, v_max, relative])
