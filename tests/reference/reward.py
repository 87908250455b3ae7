"""Reward: the paper's Table II, row by row."""

import math
from dataclasses import dataclass

from tests.reference.intersection import Floats
from tests.reference.observe import Feature
from tests.reference.traffic import BRAKING

COMFORTABLE, HARD = 2.5, 4.0  # m/s², |a| above these is penalized
COLLISION = 5000.0
SLOWEST = 1.0  # m/s², of v_min: v = sqrt(2 a d)
VIOLATED = 1e-3  # penalties that sum to more than this violate a constraint


@dataclass(frozen=True)
class Penalties:
    """The parts of one vehicle's reward that depend on where it is and how fast, as positive numbers."""

    slow: float
    fast: float
    backwards: float
    lead: float
    line: float

    def violate(self, *, slow_counts: bool) -> bool:
        """Whether their sum violates a constraint; a start may not be slow, a newcomer may."""
        return self.fast + self.backwards + self.lead + self.line + (self.slow if slow_counts else 0.0) > VIOLATED


def least_speed(features: Floats) -> float:
    """v_min of one vehicle; features: (12,)."""
    must_stop = features[Feature.DELTA] == 0
    distance = min(features[Feature.D_LEAD], features[Feature.D_STOP]) if must_stop else features[Feature.D_LEAD]
    return min(float(features[Feature.V_MAX]), math.sqrt(2 * SLOWEST * max(0.0, float(distance))))


def penalties(features: Floats) -> Penalties:
    """features: (12,) of one vehicle, delta as decided."""
    to_line, speed = float(features[Feature.D_STOP]), float(features[Feature.SPEED])
    limit, gap = float(features[Feature.V_MAX]), float(features[Feature.D_LEAD])
    braking = max(speed, 0.0) ** 2 / (2 * BRAKING)
    return Penalties(
        slow=20 / limit * max(0.0, least_speed(features) - speed),
        fast=30 / limit * max(0.0, speed - limit),
        backwards=30 * max(0.0, -speed),
        lead=30 * max(0.0, braking - gap),
        line=30 * max(0.0, braking - to_line) if features[Feature.DELTA] == 0 else 0.0,
    )


def reward(features: Floats, acceleration: float, is_to_blame: bool) -> float:
    """One vehicle's reward; features: (12,); acceleration [m/s²] of the step that led there."""
    result = 2 - 0.01 * acceleration**2
    result -= 1 if abs(acceleration) > COMFORTABLE else 0
    result -= 20 if abs(acceleration) > HARD else 0
    parts = penalties(features)
    result -= parts.slow + parts.fast + parts.backwards + parts.lead + parts.line
    return result - (COLLISION if is_to_blame else 0.0)
