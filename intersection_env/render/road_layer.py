"""What stands still in a picture of traffic: the road, the scale of lengths and the scale of speeds. Needs pygame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pygame
import shapely
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection, Route, Sample
from intersection_env.plots.map_plot import CLOSED_GAP
from intersection_env.render.camera import Camera
from intersection_env.render.ink import DIM, INK, SPEEDS, Colour, Lettering

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

GROUND: Colour = (251, 251, 249)
ASPHALT: Colour = (226, 226, 223)
KERB: Colour = (176, 176, 171)
MARKING: Colour = (255, 255, 255)
STOP: Colour = (96, 96, 94)
FINER = 4  # the road is drawn this many times larger, then averaged
EXACT = 0.01  # [m], to which the borders of the road are drawn
SHOWN_BEYOND = 1.0  # [m] outside the picture, where areas are cut off
MARKED = 2.0  # [m] from the junction at which lane borders begin
STOP_WIDTH, LINE_LENGTH = 0.5, 2.8  # [m], of a stop line: how thick, and how long at most
SAME_LINE = 2.0  # [m] between stop lines of one lane that are drawn as one
LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # [m], of which a scale bar may be
MARGIN = 14.0  # [nominal pixel] between letters and the border


@lru_cache(maxsize=16)
def still(intersection: Intersection, camera: Camera) -> NDArray[np.uint8]:
    """The picture without traffic: (height, width, 3), read-only. Drawn once for equal maps and cameras."""
    large = pygame.Surface((FINER * camera.width, FINER * camera.height), depth=32)
    large.fill(GROUND)
    shown = shapely.box(*camera.extent).buffer(SHOWN_BEYOND)
    for shape, colour in _shapes(intersection, camera):
        _fill(large, shape.intersection(shown), camera, colour)
    picture = pygame.transform.smoothscale(large, (camera.width, camera.height))
    if camera.has_letters:
        lettering = Lettering(camera.letter)
        _draw_speeds(picture, camera, lettering)
        _draw_scale(picture, camera, lettering)
    pixels = np.frombuffer(pygame.image.tobytes(picture, "RGB"), np.uint8)
    return pixels.reshape(camera.height, camera.width, 3)


def _shapes(intersection: Intersection, camera: Camera) -> Iterator[tuple[BaseGeometry, Colour]]:
    """Areas on the map [m] and their colours, each above those before."""
    pixel = camera.stroke / camera.scale
    bands = [
        shapely.make_valid(shapely.Polygon(np.concatenate([left, right[::-1]])))
        for left, right in (_sides(route.samples) for route in intersection.routes)
    ]
    paved = shapely.union_all(bands).simplify(EXACT).buffer(CLOSED_GAP).buffer(-CLOSED_GAP)
    yield paved, ASPHALT
    borders = [
        shapely.LineString(side).simplify(EXACT)
        for route in intersection.routes
        for stretch in _outside(route, intersection.spacing)
        for side in _sides(stretch)
    ]
    yield shapely.union_all(borders).buffer(0.5 * max(pixel, 0.12), cap_style="flat"), MARKING
    yield paved.boundary.buffer(0.5 * pixel), KERB
    for must_yield in (False, True):
        lines = shapely.union_all([shapely.LineString(ends) for ends in _stop_lines(intersection, must_yield)])
        yield lines.buffer(0.5 * max(STOP_WIDTH, 1.5 * pixel), cap_style="flat"), STOP if must_yield else MARKING


def _sides(samples: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The left and the right border of a lane along its samples: (sample, 2) [m] each."""
    heading, half = samples[:, Sample.HEADING].astype(np.float64), 0.5 * samples[:, [Sample.WIDTH]].astype(np.float64)
    left = half * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    return samples[:, :2] + left, samples[:, :2] - left


def _outside(route: Route, spacing: float) -> Iterator[NDArray[np.float32]]:
    """The samples of a route's approach and of its exit, where lanes are marked."""
    begin, end = (route.junction[0] - MARKED) / spacing, (route.junction[1] + MARKED) / spacing
    for stretch in (route.samples[: max(0, int(begin))], route.samples[int(np.ceil(end)) :]):
        if len(stretch) > 1:
            yield stretch


def _stop_lines(intersection: Intersection, must_yield: bool) -> Iterator[NDArray[np.float64]]:
    """The ends of the stop lines of lanes from which some route has to yield, or of the others: each (2, 2) [m].

    Where routes of one lane stop at about the same place, they share one line; all lie across their approach.
    """
    yielding = {conflict.yielder for conflict in intersection.conflicts}
    lanes: dict[int, list[list[Route]]] = {}
    for route in sorted(intersection.routes, key=lambda route: route.stop_line):
        lines = lanes.setdefault(route.stop_lane, [])
        if lines and route.stop_line - lines[-1][0].stop_line < SAME_LINE:
            lines[-1].append(route)
        else:
            lines.append([route])
    for line in (line for lines in lanes.values() for line in lines):
        if any(route.index in yielding for route in line) == must_yield:
            ends = [_sides(_at_stop_line(intersection, route)) for route in line]
            yield np.mean([np.concatenate(pair) for pair in ends], axis=0)


def _at_stop_line(intersection: Intersection, route: Route) -> NDArray[np.float32]:
    at = intersection.sample(route.index, np.array([route.stop_line], np.float32))
    approach = intersection.sample(route.index, np.array([route.junction[0]], np.float32))
    at[:, Sample.HEADING] = approach[:, Sample.HEADING]
    at[:, Sample.WIDTH] = np.minimum(at[:, Sample.WIDTH], LINE_LENGTH)
    return at


def _fill(surface: pygame.Surface, shape: BaseGeometry, camera: Camera, colour: Colour) -> None:
    """Fills an area of the map on a surface `FINER` times as large as the picture, but for its holes."""
    mask = pygame.Surface(surface.get_size(), depth=8)
    mask.set_palette([(0, 0, 0), colour])
    mask.set_colorkey((0, 0, 0))
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon) and not part.is_empty]
    for part in sorted(parts, key=lambda part: -shapely.Polygon(part.exterior).area):  # islands after what is around
        for inked, ring in ((1, part.exterior), *((0, hole) for hole in part.interiors)):
            corners = np.rint(FINER * camera.pixels(np.asarray(ring.coords)) - 0.5)
            pygame.draw.polygon(mask, inked, corners.tolist())
    surface.blit(mask, (0, 0))


def _draw_speeds(picture: pygame.Surface, camera: Camera, lettering: Lettering) -> None:
    """The colours from standing to v_max, in the lower left corner."""
    unit = camera.letter
    left, low = MARGIN * unit, camera.height - MARGIN * unit
    width, height = round(110.0 * unit), round(7.0 * unit)
    top = round(low - 13.0 * unit - height)
    for column in range(width):
        colour = SPEEDS[column * len(SPEEDS) // width]
        picture.fill(colour, (round(left) + column, top, 1, height))
    pygame.draw.rect(picture, DIM, (round(left) - 1, top - 1, width + 2, height + 2), 1)
    lettering.draw(picture, "standing", (left, low), DIM)
    subscript = Lettering(0.8 * unit).draw(picture, "max", (left + width, low + 2.0 * unit), DIM, align=1.0)
    lettering.draw(picture, "v", (subscript - unit, low), DIM, align=1.0)


def _draw_scale(picture: pygame.Surface, camera: Camera, lettering: Lettering) -> None:
    """A bar of so many metres, in the lower right corner."""
    unit = camera.letter
    fitting: Sequence[int] = [length for length in LENGTHS if length * camera.scale <= 0.25 * camera.width]
    length = fitting[-1] if fitting else LENGTHS[0]
    right, low = camera.width - MARGIN * unit, camera.height - MARGIN * unit
    width, thick = length * camera.scale, max(1, round(1.2 * unit))
    top = round(low - 16.0 * unit)
    picture.fill(INK, (round(right - width), top, round(width), thick))
    for end in (right - width, right - thick):
        picture.fill(INK, (round(end), top - round(3.0 * unit), thick, round(6.0 * unit) + thick))
    lettering.draw(picture, f"{length} m", (right - 0.5 * width, low), DIM, align=0.5)
