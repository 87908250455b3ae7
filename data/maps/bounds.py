"""Bounds of lanelets, made to face each other, and lanelets that follow each other by where they lie."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from data.maps.lanelets import Lanelet
from intersection_env.maps.curve import Points

TOUCH = 0.3  # [m], ours: bounds that end nearer to where others begin lead into them


def distinct(where: str, values: Iterable[Iterable[float] | NDArray[np.float64]]) -> Points:
    """The points of a bound, without those that repeat the one before.

    Raises:
        ValueError: fewer than two are left.
    """
    points = np.array([list(one) for one in values], dtype=np.float64).reshape(-1, 2)
    if len(points):
        points = points[np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-3]]
    if len(points) < 2:
        raise ValueError(f"{where}: {len(points)} points apart from each other; wanted two or more")
    return points


def joined(where: str, lines: Iterable[Points]) -> Points:
    """One line of several that follow each other, in whichever order and direction each is drawn.

    Raises:
        ValueError: there is none, or they do not touch; the message begins with `where`.
    """
    open_ = list(lines)
    if not open_:
        raise ValueError(f"{where} is missing")
    whole = open_.pop(0)
    while open_:
        number, turned = min(
            ((number, turned) for number in range(len(open_)) for turned in range(4)),
            key=lambda one: _gap(whole, open_[one[0]], one[1]),
        )
        if _gap(whole, open_[number], turned) > TOUCH:
            raise ValueError(f"{where}: its lines do not follow each other")
        line = open_.pop(number)
        line = line[::-1] if turned % 2 else line
        whole = np.concatenate([whole, line[1:]] if turned < 2 else [line, whole[1:]])
    return whole


def _gap(whole: Points, line: Points, turned: int) -> float:
    """How far a line is from going on (0, reversed 1) or leading in (2, reversed 3) [m]."""
    line = line[::-1] if turned % 2 else line
    ends = (whole[-1], line[0]) if turned < 2 else (line[-1], whole[0])
    return float(np.linalg.norm(ends[0] - ends[1]))


def facing(left: Points, right: Points) -> tuple[Points, Points]:
    """Both bounds in driving direction, whichever way each is drawn: then the left one lies to the left."""
    same = np.linalg.norm(left[0] - right[0]) + np.linalg.norm(left[-1] - right[-1])
    if np.linalg.norm(left[0] - right[-1]) + np.linalg.norm(left[-1] - right[0]) < same:
        right = right[::-1]
    ring = np.concatenate([left, right[::-1]])
    east, north = (ring - ring.mean(axis=0)).T
    area = np.sum(east * np.roll(north, -1) - np.roll(east, -1) * north)
    return (left, right) if area < 0.0 else (left[::-1], right[::-1])


def follow_each_other(lanelets: dict[str, Lanelet]) -> dict[str, Lanelet]:
    """The lanelets, each with those as successors whose two bounds begin where its own end."""
    ids = list(lanelets)
    begin = np.array([np.concatenate([lanelets[id].left[0], lanelets[id].right[0]]) for id in ids])
    found = {}
    for id, one in lanelets.items():
        away = np.abs(begin - np.concatenate([one.left[-1], one.right[-1]])).max(axis=1)
        after = tuple(other for other, far in zip(ids, away, strict=True) if far < TOUCH and not _back(id, other))
        found[id] = replace(one, successors=after)
    return found


def _back(one: str, other: str) -> bool:
    """Whether two ids are the two directions of one lanelet."""
    return one.removesuffix("-") == other.removesuffix("-")
