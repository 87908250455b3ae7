"""A single-lane four-arm junction, right before left: the paper's example stands on it."""

from __future__ import annotations

import json
from collections.abc import Sequence

ARMS = {"E": (1, 0), "N": (0, 1), "W": (-1, 0), "S": (0, -1)}
LANE, NEAR, FAR = 1.75, 8.0, 100.0  # [m]: lane centre from the axis, lane end and map end from the centre


def single_lane_source(
    near: float = NEAR, far: float = FAR, yields: Sequence[tuple[str, str]] = (), limit: float = 30.0
) -> str:
    """The map source as JSON; all arms are equal and every pair of arms has a route.

    near, far: where lanes end, from the centre [m]; limit: [km/h].
    """
    lanes = {}
    for name, (x, y) in ARMS.items():
        side_x, side_y = -y * LANE, x * LANE  # incoming traffic keeps to the left of the outward direction
        inward = [[x * r + side_x, y * r + side_y] for r in (far, near)]
        outward = [[x * r - side_x, y * r - side_y] for r in (near, far)]
        lanes[f"{name}_in"] = {"width": 3.5, "points": inward}
        lanes[f"{name}_out"] = {"width": 3.5, "points": outward}
    routes = {f"{a}-{b}": {"approach": [f"{a}_in"], "exit": [f"{b}_out"]} for a in ARMS for b in ARMS if a != b}
    source = {
        "format": "intersection_env map source",
        "version": 2,
        "name": "single_lane",
        "locations": [],
        "arms": {name: {"right_of_way": "priority", "speed_limit_kmh": limit} for name in ARMS},
        "lanes": lanes,
        "stop_lines": {},
        "routes": routes,
        "yields": [list(pair) for pair in yields],
    }
    return json.dumps(source)
