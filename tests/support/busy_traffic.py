"""Traffic by hand with many open pairs."""

from __future__ import annotations

from intersection_env import Intersection, Traffic, Vehicle

BENDPLATZ, T = Intersection.load("bendplatz"), Intersection.load("t_junction")


def busy() -> Traffic:
    """Eight vehicles, nineteen open pairs."""
    return Traffic.of(
        BENDPLATZ,
        [
            Vehicle("a", "NW-SE", 110, 12),
            Vehicle("b", "NW-SE", 95, 12),
            Vehicle("c", "NE-SW", 83, 0),
            Vehicle("d", "NE-SE", 75, 0),
            Vehicle("e", "SW-NW", 83, 0),
            Vehicle("f", "SE-NW", 100, 12),
            Vehicle("g", "SE-SW", 150, 0),
            Vehicle("h", "NW-NE", 140, 5),
        ],
    )
