"""A single-lane four-arm junction, right before left: the paper's example stands on it."""

from __future__ import annotations

import json

ARMS = {"E": (1, 0), "N": (0, 1), "W": (-1, 0), "S": (0, -1)}
LANE, NEAR, FAR = 1.75, 8.0, 100.0  # [m]: lane centre from the axis, lane end and map end from the centre


def single_lane_source() -> str:
    """The map source as JSON; all arms are equal and every pair of arms has a route."""
    lanes = {}
    for name, (x, y) in ARMS.items():
        side_x, side_y = -y * LANE, x * LANE  # incoming traffic keeps to the left of the outward direction
        inward = [[x * r + side_x, y * r + side_y] for r in (FAR, NEAR)]
        outward = [[x * r - side_x, y * r - side_y] for r in (NEAR, FAR)]
        lanes[f"{name}_in"] = {"width": 3.5, "points": inward}
        lanes[f"{name}_out"] = {"width": 3.5, "points": outward}
    routes = {f"{a}-{b}": {"approach": [f"{a}_in"], "exit": [f"{b}_out"]} for a in ARMS for b in ARMS if a != b}
    source = {
        "format": "intersection_env map source",
        "version": 2,
        "name": "single_lane",
        "locations": [],
        "arms": {name: {"right_of_way": "priority", "speed_limit_kmh": 30} for name in ARMS},
        "lanes": lanes,
        "stop_lines": {},
        "routes": routes,
        "yields": [],
    }
    return json.dumps(source)
