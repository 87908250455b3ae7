"""The colours of plots."""

from __future__ import annotations

from intersection_env.maps.intersection import Intersection

ARMS = ("#2f6da8", "#b5483a", "#2f8257", "#7b5aa6", "#8a6d3b", "#4f5b66")
CROSSING, MERGING = "#e69a2e", "#5aa7b8"
ASPHALT, KERB, INK = "#e9e9e7", "#c4c4c0", "#2b2b2b"
GREY, PALE = "#8c8c88", "#c9c9c6"


def arm_colours(intersection: Intersection) -> dict[str, str]:
    """One colour for each arm from which routes come."""
    arms = dict.fromkeys(route.entry for route in intersection.routes)
    return {arm: ARMS[number % len(ARMS)] for number, arm in enumerate(arms)}


def route_colour(intersection: Intersection, route: int) -> str:
    """The colour of the arm from which a route comes."""
    return arm_colours(intersection)[intersection.routes[route].entry]
