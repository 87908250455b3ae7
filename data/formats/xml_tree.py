"""Reads XML files, naming the file when one is damaged."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

FARTHEST = 1e8  # [m], ours: no place on the Earth has larger coordinates, whatever the projection


def read_xml(path: Path, root: str) -> Element:
    """The root element of a file, which must be called so.

    Raises:
        ValueError: the file is no XML, or its root is called otherwise.
        OSError: the file cannot be read.
    """
    content = path.read_bytes()
    try:
        element = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"{path}: not XML, or truncated: {error}") from None
    if element.tag != root:
        raise ValueError(f"{path}: the root element is <{element.tag}>; wanted <{root}>")
    return element


def text_of(element: Element, path: str) -> str | None:
    """The text at a path below an element, without blanks around it; None where there is none."""
    found = element.find(path)
    text = "" if found is None else (found.text or "").strip()
    return text or None


def number(where: str, text: str | None) -> float:
    """A finite number.

    Raises:
        ValueError: the text is none; the message begins with `where`.
    """
    try:
        value = math.nan if text is None else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{where}: {'nothing' if text is None else repr(text)}; wanted a finite number")
    return value
