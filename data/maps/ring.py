"""Roundabouts: lanelets inside the junction that go round, and ways cut at where they enter and leave them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from data.maps.arms import ArmLanes
from data.maps.lanelets import LaneMap
from data.maps.paths import Way


def ring_of(lane_map: LaneMap, inside: Iterable[str]) -> frozenset[str]:
    """The lanelets inside the junction from which a way leads back to themselves, inside it."""
    within = set(inside)
    after = {id: [one for one in lane_map.lanelets[id].successors if one in within] for id in within}
    return frozenset(id for id in within if id in _reached(after, id))


def around(way: Way, ring: frozenset[str]) -> Way | None:
    """The way, inside only while it goes round; None where it does not."""
    places = [number for number, id in enumerate(way.inside) if id in ring]
    if not places:
        return None
    first, last = places[0], places[-1] + 1
    return Way(way.approach + way.inside[:first], way.inside[first:last], way.inside[last:] + way.leaving)


def arms_of_ring(arms: Iterable[ArmLanes], ways: Mapping[str, Way], ring: frozenset[str]) -> set[str]:
    """The arms from which every way (by route id) goes round."""
    found = set()
    for arm in arms:
        own = [way for id, way in ways.items() if id.partition("-")[0] == arm.name]
        if own and all(around(way, ring) is not None for way in own):
            found.add(arm.name)
    return found


def _reached(after: Mapping[str, list[str]], start: str) -> set[str]:
    found: set[str] = set()
    open_ = list(after[start])
    while open_:
        one = open_.pop()
        if one not in found:
            found.add(one)
            open_ += after[one]
    return found
