"""Shapes of CommonRoad's obstacles, as the rectangle around each."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from data.formats.xml_tree import number, text_of


class Shape(NamedTuple):
    """A body's length and width [m], and where its middle lies ahead and to the left of the state's position [m]."""

    length: float
    width: float
    centre: tuple[float, float]


def shape_of(where: str, element: Element | None) -> Shape:
    """The rectangle around a shape: a rectangle along the body, a circle or a polygon.

    Raises:
        ValueError: there is none, or one of another kind; the message begins with `where`.
    """
    found = [] if element is None else [one for one in element if one.tag in ("rectangle", "circle", "polygon")]
    if len(found) != 1:
        raise ValueError(f"{where}: {len(found)} shapes; wanted one rectangle, circle or polygon")
    shape = found[0]
    if shape.tag == "polygon":
        points = [[number(f"{where}, shape", text_of(one, axis)) for axis in ("x", "y")] for one in shape.iter("point")]
        if len(points) < 3:
            raise ValueError(f"{where}: a polygon of {len(points)} points; wanted three or more")
        least, most = np.min(points, axis=0), np.max(points, axis=0)
        (length, width), (ahead, left) = (most - least).tolist(), (0.5 * (least + most)).tolist()
        return Shape(length, width, (ahead, left))
    centre = tuple(number(f"{where}, shape", text_of(shape, f"center/{axis}") or "0") for axis in ("x", "y"))
    if shape.tag == "circle":
        size = 2.0 * number(f"{where}, radius", text_of(shape, "radius"))
        return Shape(size, size, (centre[0], centre[1]))
    turned = number(f"{where}, shape", text_of(shape, "orientation") or "0")
    if abs(np.sin(turned)) > 0.02:
        raise ValueError(f"{where}: a rectangle turned by {turned:g} rad to its own heading; wanted 0")
    length, width = (number(f"{where}, {name}", text_of(shape, name)) for name in ("length", "width"))
    return Shape(length, width, (centre[0], centre[1]))
