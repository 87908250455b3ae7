"""Leaves of an XML tree that is built, not read."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol
from xml.etree.ElementTree import Element, SubElement


class HasPlace(Protocol):
    """What lies somewhere [m]."""

    @property
    def x(self) -> float: ...

    @property
    def y(self) -> float: ...


def leaf(element: Element, tag: str, value: str | float) -> None:
    """Adds a child with a text, or with a number that reads back as the same."""
    SubElement(element, tag).text = value if isinstance(value, str) else repr(value)


def place(element: Element, point: HasPlace) -> None:
    """Adds the children x and y."""
    leaf(element, "x", point.x)
    leaf(element, "y", point.y)


def points(element: Element, places: Iterable[HasPlace]) -> None:
    """Adds a child `point` for each place."""
    for one in places:
        place(SubElement(element, "point"), one)


def references(element: Element, tag: str, ids: Iterable[int]) -> None:
    """Adds a child with the attribute `ref` for each id."""
    for id in ids:
        SubElement(element, tag, ref=str(id))


def words(element: Element, tag: str, known: tuple[str, ...], numbers: Iterable[int]) -> None:
    """Adds a child for each number, with its word; one that is not known is called by its number."""
    for number in numbers:
        leaf(element, tag, known[number] if 0 <= number < len(known) else f"number {number}")
