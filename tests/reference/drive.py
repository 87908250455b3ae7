"""Drive and advance: what a vehicle does by the IDM, a network or at constant velocity, and where that takes it."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tests.reference.intersection import Booleans, Floats, Map, Sample
from tests.reference.networks import Network, evaluate
from tests.reference.observe import Feature
from tests.reference.traffic import BRAKING, TIME_STEP, Traffic

Driver = Literal["idm", "network", "constant_velocity"]
NETWORK_ACCELERATION = 6.0  # m/s²


# IDM


@dataclass(frozen=True)
class Idm:
    """Parameters; lateral: [m/s²], None where curves slow nobody."""

    standstill_gap: float = 1.5
    headway: float = 1.0
    acceleration: float = 2.5
    deceleration: float = 4.0
    hardest_braking: float = 8.0
    speed_share: float = 1.0
    lateral: float | None = None


PAPER_IDM = Idm()


def idm(speed: float, free_speed: float, gap: float, lead_speed: float, p: Idm = PAPER_IDM) -> float:
    """The acceleration [m/s²] behind one lead, not yet limited."""
    road = p.acceleration * (1 - (speed / free_speed) ** 4)
    reach = (free_speed - speed) / TIME_STEP
    road = min(road, reach) if speed <= free_speed else max(road, reach)
    approach = speed * (speed - lead_speed) / (2 * math.sqrt(p.acceleration * p.deceleration))
    desired = p.standstill_gap + max(0.0, speed * p.headway + approach)
    return road - p.acceleration * (desired / max(gap, 0.1)) ** 2


def free_speeds(intersection: Map, route: int, p: Idm) -> Floats:
    """(sample,): how fast the IDM goes with nobody ahead, so slowly into curves that it can brake for them by b."""
    samples = intersection.routes[route].samples
    allowed = p.speed_share * samples[:, Sample.V_MAX]
    if p.lateral is None:
        return np.asarray(allowed)
    turning = np.abs(samples[:, Sample.HEADING_3_AHEAD] - samples[:, Sample.HEADING_3_BEHIND])
    curvature = np.maximum(turning, 1e-4) / 6.0
    allowed = np.minimum(allowed, np.sqrt(p.lateral / curvature))
    along = np.arange(len(allowed)) * intersection.spacing
    return np.array(
        [np.sqrt(allowed[k:] ** 2 + 2 * p.deceleration * (along[k:] - along[k])).min() for k in range(len(allowed))]
    )


def free_speed(intersection: Map, traffic: Traffic, i: int, p: Idm) -> float:
    """The table's at the vehicle's centre, or the vehicle's own top speed."""
    table = free_speeds(intersection, int(traffic.route[i]), p)
    along = np.arange(len(table)) * intersection.spacing
    return float(min(np.interp(traffic.position[i], along, table), traffic.max_speed[i]))


# Network


def limited(features: Floats, wanted: float) -> float:
    """What a network may do: stay able to stop behind its lead, and not cross a line where it must wait."""
    to_line, speed = float(features[Feature.D_STOP]), float(features[Feature.SPEED])
    lead_gap, lead_speed = float(features[Feature.D_LEAD]), float(features[Feature.V_LEAD])
    lead_next = max(0.0, lead_speed - TIME_STEP * NETWORK_ACCELERATION)
    lead_stops = TIME_STEP * (lead_speed + lead_next) / 2 + lead_next**2 / (2 * NETWORK_ACCELERATION)
    bounds = [(lead_gap + lead_stops - 1.0, NETWORK_ACCELERATION)]
    if features[Feature.DELTA] == 0:
        bounds.append((to_line - 0.4, BRAKING))
    allowed = wanted
    for distance, b in bounds:
        following = max(0.0, speed + TIME_STEP * wanted)
        if TIME_STEP * (speed + following) / 2 + following**2 / (2 * b) > distance:
            rest = distance - TIME_STEP * speed / 2
            following = b * (math.sqrt(max(0.0, TIME_STEP**2 / 4 + 2 * rest / b)) - TIME_STEP / 2)
            allowed = min(allowed, (following - speed) / TIME_STEP)
    return allowed if allowed == wanted else max(allowed, -NETWORK_ACCELERATION)


# Every driver


def drive(
    features: Floats, driver: Driver, network: Network | None, free: float, top: float, p: Idm = PAPER_IDM
) -> float:
    """The acceleration [m/s²] of one vehicle; features: (12,).

    free: the IDM's speed with nobody ahead [m/s]; top: the vehicle's own top speed [m/s].
    """
    speed = float(features[Feature.SPEED])
    if driver == "constant_velocity":
        return 0.0
    if driver == "network":
        assert network is not None, "driver='network' needs driver_network"
        wanted = NETWORK_ACCELERATION * math.tanh(evaluate(network, features, "tanh"))
        return limited(features, min(wanted, (max(speed, top) - speed) / TIME_STEP))
    to_line = float(features[Feature.D_STOP])
    gap, lead_speed = float(features[Feature.D_LEAD]), float(features[Feature.V_LEAD])
    acceleration = idm(speed, free, gap, lead_speed, p)
    if features[Feature.DELTA] == 0:
        acceleration = min(acceleration, idm(speed, free, to_line, 0.0, p))
    return min(max(acceleration, -p.hardest_braking), p.acceleration)


# Advance


def advance(intersection: Map, traffic: Traffic, present: Booleans, wanted: Floats) -> tuple[Traffic, Booleans, Floats]:
    """The traffic and presence one step later, and the acceleration that was reached (vehicle,)."""
    position, speed, still = traffic.position.copy(), traffic.speed.copy(), present.copy()
    reached = np.zeros(len(position))
    for i in np.flatnonzero(present).tolist():
        before = speed[i]
        speed[i] = max(0.0, before + TIME_STEP * wanted[i])
        position[i] += TIME_STEP * (before + speed[i]) / 2
        reached[i] = (speed[i] - before) / TIME_STEP
        still[i] = position[i] < intersection.routes[traffic.route[i]].length
    return replace(traffic, position=position, speed=speed), still, reached
