"""Who yields where two routes conflict: by the source's own word, else by the general rule."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intersection_env.maps.curve import wrap
from intersection_env.maps.meeting import Interval
from intersection_env.maps.route import CompiledRoute
from intersection_env.maps.source import MapSource

MINOR = ("yield", "stop", "all_way_stop", "roundabout")
BY_THE_RIGHT = ("right_before_left", "all_way_stop")  # between two such arms turns come second
FROM_THE_SIDE = np.radians(20.0), np.radians(160.0)  # ours: less is from behind or beside, more from ahead


class Ruling(NamedTuple):
    """Whether the first of two routes yields; None where nobody says. circulates: as one is in a roundabout."""

    first_yields: bool | None
    circulates: bool = False


def ruling(source: MapSource, a: CompiledRoute, b: CompiledRoute, on_a: Interval, on_b: Interval) -> Ruling:
    """Who yields in a conflict of two routes, given by its interval on each [m]."""
    if (a.source.id, b.source.id) in source.yields:
        return Ruling(True)
    if (b.source.id, a.source.id) in source.yields:
        return Ruling(False)
    rights = _rights(source, a, b)
    if rights == ("roundabout", "roundabout"):
        inside_a, inside_b = (on[0] > one.circulates_from for one, on in ((a, on_a), (b, on_b)))
        if inside_a != inside_b:
            return Ruling(inside_b, circulates=True)
    by_rank = _later(_rank(source, a), _rank(source, b))
    from_right = _from_right(source, a, b)
    by_turn = _later(*(source.turn(one.source) == "left" for one in (a, b)))
    ranks = (from_right, by_turn) if all(one in BY_THE_RIGHT for one in rights) else (by_rank, by_turn, from_right)
    return Ruling(next((one for one in ranks if one is not None), None))


def is_by_arrival(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> bool:
    """Whether both come from an all-way stop."""
    return _rights(source, a, b) == ("all_way_stop", "all_way_stop")


def who_waits(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> tuple[str, str]:
    """What to propose for routes that no rule orders: who turns waits for who runs straight, else b for a."""
    one, other = a.source, b.source
    if source.turn(one) != "straight" and source.turn(other) == "straight":
        return one.id, other.id
    return other.id, one.id


def _rights(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> tuple[str, str]:
    return source.arms[a.source.entry].right_of_way, source.arms[b.source.entry].right_of_way


def _rank(source: MapSource, route: CompiledRoute) -> bool:
    return source.arms[route.source.entry].right_of_way in MINOR


def _later(a: bool, b: bool) -> bool | None:
    """Whether the first is the one of which something holds that makes it wait; None where it holds of both or none."""
    return None if a == b else a


def _from_right(source: MapSource, a: CompiledRoute, b: CompiledRoute) -> bool | None:
    """Whether b comes from the right of a; None where they come from one side, or face each other."""
    bearing = wrap(source.approach_heading(b.source) - source.approach_heading(a.source))
    least, most = FROM_THE_SIDE
    return bearing > 0.0 if least < abs(bearing) < most else None
