"""Cars placed by hand on the shipped maps, for the twin: each so far before its stop line, and so fast."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.reference.intersection import Map
from tests.reference.traffic import Traffic
from tests.support.twins import twin_map

T_JUNCTION, BENDPLATZ = twin_map("t_junction"), twin_map("bendplatz")
BOTH = pytest.mark.parametrize("intersection", [T_JUNCTION, BENDPLATZ], ids=["t_junction", "bendplatz"])


def place(intersection: Map, *vehicles: tuple[str, float, float]) -> Traffic:
    """Cars of 4 m x 2 m from (route id, front's distance before its stop line [m], speed [m/s])."""
    names = [route.id for route in intersection.routes]
    route = np.array([names.index(name) for name, _, _ in vehicles], dtype=np.int64)
    lines = [intersection.routes[r].stop_line for r in route]
    position = np.array([line - before - 2 for line, (_, before, _) in zip(lines, vehicles, strict=True)])
    count = len(vehicles)
    speed = np.array([v for _, _, v in vehicles], dtype=np.float64)
    return Traffic(route, position, speed, np.full(count, 4.0), np.full(count, 2.0), np.full(count, math.inf))
