"""What stands still in a picture of traffic: the road, the scale of lengths and the scale of speeds. Needs pygame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pygame
import shapely
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection
from intersection_env.maps.outline import outside, painted_stop_lines, pavement, polygons, sides
from intersection_env.render.camera import Camera
from intersection_env.render.ink import DIM, INK, MARGIN, SPEEDS, Colour, Lettering

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
BORDER_WIDTH, STOP_WIDTH = 0.12, 0.5  # [m], how thick the border of a lane, and a stop line, are at least
LONGEST_LINE = 2.8  # [m], of stop lines
LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # [m], of which a scale bar may be


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
    paved = pavement((route.samples.astype(np.float64) for route in intersection.routes), EXACT)
    yield paved, ASPHALT
    borders = [
        shapely.LineString(side).simplify(EXACT)
        for route in intersection.routes
        for stretch in outside(intersection, route)
        for side in sides(stretch.astype(np.float64))
    ]
    yield shapely.union_all(borders).buffer(0.5 * max(pixel, BORDER_WIDTH), cap_style="flat"), MARKING
    yield paved.boundary.buffer(0.5 * pixel), KERB
    stop_lines = list(painted_stop_lines(intersection, LONGEST_LINE))
    for must_yield, colour in ((False, MARKING), (True, STOP)):
        lines = [shapely.LineString(line.ends) for line in stop_lines if line.must_yield == must_yield]
        thick = max(STOP_WIDTH, 1.5 * pixel)
        yield shapely.union_all(lines).buffer(0.5 * thick, cap_style="flat"), colour


def _fill(surface: pygame.Surface, shape: BaseGeometry, camera: Camera, colour: Colour) -> None:
    """Fills an area of the map on a surface `FINER` times as large as the picture, but for its holes."""
    mask = pygame.Surface(surface.get_size(), depth=8)
    mask.set_palette([(0, 0, 0), colour])
    mask.set_colorkey((0, 0, 0))
    # Islands come after what is around them.
    for part in sorted(polygons(shape), key=lambda part: -shapely.Polygon(part.exterior).area):
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
