"""Random traffic to compare core and twin on."""

import math
from dataclasses import replace

import numpy as np

from tests.reference.bodies import body_distance
from tests.reference.intersection import Map, Sample, sample
from tests.reference.lead import lead_gaps
from tests.reference.outputs import can_touch
from tests.reference.traffic import FIELDS, Traffic

BICYCLE_SPEED = 5.0  # m/s


def random_traffic(intersection: Map, generator: np.random.Generator, vehicles: int, past_line: float = 0.0) -> Traffic:
    """Plausible traffic: mostly near the junction, no bodies closer than 0.3 m, no gaps in a lane below 1 m.

    Every value is exact in float32, so that twin and core start from the same traffic. past_line: the share of vehicles
    that stand or creep past their line, before their first conflict. All are on their routes, however short those are
    before the line or behind the junction.
    """
    sizes = ((4.5, 1.8, math.inf), (4.1, 1.75, math.inf), (12.0, 2.5, math.inf), (1.8, 0.6, BICYCLE_SPEED))
    traffic = Traffic(np.zeros(0, np.int64), *(np.zeros(0) for _ in range(5)))
    for _ in range(1000 * vehicles + 1):
        if len(traffic.route) == vehicles:
            return traffic
        route = int(generator.integers(len(intersection.routes)))
        road = intersection.routes[route]
        length, width, max_speed = sizes[generator.choice(4, p=(0.4, 0.35, 0.1, 0.15))]
        before, behind = max(road.stop_line - 45, 0.0), min(road.junction_end + 15, road.length)
        near = (before, road.stop_line), (road.stop_line, behind), (0.0, road.stop_line)
        position = float(np.float32(generator.uniform(*near[generator.choice(3, p=(0.7, 0.2, 0.1))])))
        limit = min(float(sample(intersection, route, position)[Sample.V_MAX]), max_speed)
        speed = 0.0 if generator.random() < 0.15 else float(generator.uniform(0, 1.1)) * limit
        if past_line and generator.random() < past_line and road.first_conflict > road.stop_line:
            front = float(generator.uniform(road.stop_line, road.first_conflict))
            position, speed = float(np.float32(front - length / 2)), float(generator.choice((0.0, generator.random())))
        fields = (route, position, *(float(np.float32(x)) for x in (speed, length, width, max_speed)))
        tried = replace(
            traffic, **{n: np.append(getattr(traffic, n), np.asarray(x)) for n, x in zip(FIELDS, fields, strict=True)}
        )
        if 0.0 <= position < road.length and _is_free(intersection, tried):
            traffic = tried
    raise ValueError(f"random_traffic: no room for {vehicles} vehicles on {intersection.name}")


def _is_free(intersection: Map, traffic: Traffic) -> bool:
    """Whether the last vehicle keeps its distance from all others."""
    last = len(traffic.route) - 1
    for other in range(last):
        gaps = lead_gaps(intersection, traffic, last, other) + lead_gaps(intersection, traffic, other, last)
        if min(gaps, default=math.inf) < 1.0:
            return False
        if can_touch(intersection, traffic, last, other) and body_distance(intersection, traffic, last, other) < 0.3:
            return False
    return True
