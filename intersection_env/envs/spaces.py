"""What an agent may do and can ever see, as Gymnasium's spaces."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.spaces import Box

from intersection_env import _core
from intersection_env.constants import ACCELERATION, DT, FREE_LEAD_SPEED, LEAD_RANGE
from intersection_env.features import Driving
from intersection_env.maps.intersection import Intersection, Sample

ROUNDING = 0.1  # [m] and [m/s], on top of every bound: float32 along a route


def action_space() -> Box[np.float32]:
    """One number in [-1, 1], times 6 m/s²."""
    return Box(-1.0, 1.0, (1,), np.float32)


def observation_space(intersection: Intersection, fastest: float, backing: bool) -> Box[np.float32]:
    """The twelve features in their units, within bounds that nothing on this map can exceed.

    Whoever accelerates with 6 m/s² all along the longest route, from `fastest`, is at its end no faster than
    sqrt(fastest² + 2 · 6 m/s² · length), and at most one step beyond it.

    Args:
        fastest: the highest speed anyone starts with, or is recorded with [m/s].
        backing: whether speeds may fall below 0.
    """
    routes = intersection.routes
    length = max(route.length for route in routes)
    speed = math.sqrt(fastest**2 + 2.0 * ACCELERATION * length) + ACCELERATION * DT + ROUNDING
    beyond = speed * DT + ROUNDING
    turn = max(math.pi, *(float(np.abs(route.samples[:, Sample.HEADINGS :]).max()) for route in routes))
    v_max = max(float(route.samples[:, Sample.V_MAX].max()) for route in routes)
    past_line = max(route.length - route.stop_line for route in routes) + beyond + 0.5 * _core.MOST_LENGTH
    before_line = max(route.stop_line for route in routes) + (beyond if backing else 0.0)
    slowest = -speed if backing else 0.0
    bounds: dict[int, tuple[float, float]] = {
        Driving.DISTANCE_TO_STOP_LINE: (-past_line, before_line),
        Driving.SPEED: (slowest, speed),
        Driving.V_MAX: (0.0, v_max + ROUNDING),
        **{column: (-turn, turn) for column in range(Driving.HEADINGS, Driving.LEAD_DISTANCE)},
        Driving.LEAD_DISTANCE: (-_core.MOST_LENGTH, LEAD_RANGE),
        Driving.LEAD_SPEED: (slowest, max(speed, FREE_LEAD_SPEED)),
        Driving.ENTERS: (0.0, 1.0),
    }
    low, high = zip(*(bounds[column] for column in range(len(bounds))), strict=True)
    return Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)
