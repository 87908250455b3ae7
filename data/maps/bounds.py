"""Bounds of lanelets, made to face each other, and lanelets that follow each other by where they lie."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from data.formats.xml_tree import FARTHEST
from data.maps.lanelets import Lanelet
from intersection_env.maps.curve import Points, wrap

LOOSE = 4.0  # [m], ours: where one bound touches only, centrelines are at most a lane apart
STRAIGHT_ON = np.radians(45.0)  # ours: and their headings differ by less
HEADING_OVER = 6  # ours: of a centreline's points, half a metre apart, its heading is taken over so many
LONGEST = 100e3  # [m], ours: no lanelet is longer; one is with a digit too many in a point
TOUCH = 0.3  # [m], ours: bounds that end nearer to where others begin lead into them


def distinct(where: str, values: Iterable[Iterable[float] | NDArray[np.float64]]) -> Points:
    """The points of a bound, without those that repeat the one before.

    Raises:
        ValueError: fewer than two are left, or they are farther apart than a lane is long.
    """
    points = np.array([list(one) for one in values], dtype=np.float64).reshape(-1, 2)
    if len(points):
        far = np.abs(points).max()
        if far > FARTHEST:
            raise ValueError(f"{where}: a point {far:g} m from 0; wanted at most {FARTHEST:g}")
        across = np.ptp(points, axis=0).max()
        if across > LONGEST:
            raise ValueError(f"{where}: points {across:g} m apart; wanted at most {LONGEST:g}")
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


def with_loose_joints(lanelets: dict[str, Lanelet]) -> tuple[dict[str, Lanelet], frozenset[tuple[str, str]]]:
    """The lanelets, where one that leads nowhere, or is led to by none, has a neighbour at one bound; and the joints.

    Maps are drawn such that only the left or the right bounds touch. Then the nearest lanelet of about the same
    heading is the next one.
    """
    led_to = {other for one in lanelets.values() for other in one.successors}
    ends = {id: _ends(one) for id, one in lanelets.items()}
    joints: set[tuple[str, str]] = set()
    for id, one in lanelets.items():
        if not one.successors:
            joints |= _nearest(id, [(id, other) for other in lanelets], lanelets, ends)
        if id not in led_to:
            joints |= _nearest(id, [(other, id) for other in lanelets], lanelets, ends)
    found = dict(lanelets)
    for before, after in sorted(joints):
        found[before] = replace(found[before], successors=(*found[before].successors, after))
    return found, frozenset(joints)


def _ends(one: Lanelet) -> tuple[Points, float, float]:
    """Begin and end of the centreline (2, 2) [m], and the headings there [rad]."""
    points = one.centre()[0]
    near = min(HEADING_OVER, len(points) - 1)
    ways = points[near] - points[0], points[-1] - points[-1 - near]
    first, last = (float(np.arctan2(north, east)) for east, north in ways)
    return points[[0, -1]], first, last


def _nearest(
    id: str,
    pairs: Iterable[tuple[str, str]],
    lanelets: dict[str, Lanelet],
    ends: dict[str, tuple[Points, float, float]],
) -> set[tuple[str, str]]:
    """Of pairs (before, after) the one that fits best with one bound touching; empty where none does."""
    scored = []
    for before, after in pairs:
        if before == after or _back(before, after):
            continue
        one, other = lanelets[before], lanelets[after]
        sides = (one.left[-1] - other.left[0], one.right[-1] - other.right[0])
        away = float(np.linalg.norm(ends[before][0][1] - ends[after][0][0]))
        turn = abs(wrap(ends[after][1] - ends[before][2]))
        if min(np.linalg.norm(side) for side in sides) < TOUCH and away < LOOSE and turn < STRAIGHT_ON:
            scored.append((away, before, after))
    return {min(scored)[1:]} if scored else set()


def _back(one: str, other: str) -> bool:
    """Whether two ids are the two directions of one lanelet."""
    return one.removesuffix("-") == other.removesuffix("-")
