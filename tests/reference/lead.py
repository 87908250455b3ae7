"""Lead: who leads whom, and with which gap."""

import math

from tests.reference.intersection import Booleans, Map
from tests.reference.traffic import Traffic, front, rear

LEAD_RANGE = 100.0  # m
LEAD_SPEED = 100 / 3.6  # m/s, without a lead


def lead_gaps(intersection: Map, traffic: Traffic, i: int, j: int) -> list[float]:
    """The bumper-to-bumper gap under each of the rules by which j leads i; empty if it does not."""
    gaps = []
    bodies = (traffic.length[i] + traffic.length[j]) / 2
    s_i, s_j = traffic.position[i], traffic.position[j]
    if traffic.route[i] == traffic.route[j] and s_j > s_i:
        gaps.append(float(s_j - s_i - bodies))
    for lane in intersection.shared_lanes:
        if (traffic.route[i], traffic.route[j]) == (lane.a, lane.b):
            begin, end, offset = lane.begin_b, lane.end, lane.offset
        elif (traffic.route[i], traffic.route[j]) == (lane.b, lane.a):
            begin, end, offset = lane.begin_a, lane.end + lane.offset, -lane.offset
        else:
            continue
        both_before_end = rear(traffic, i) < end and rear(traffic, j) - offset < end
        if both_before_end and front(traffic, j) > begin and s_j - offset > s_i:
            gaps.append(float(s_j - offset - s_i - bodies))
    return gaps


def lead(intersection: Map, traffic: Traffic, present: Booleans, i: int) -> tuple[int | None, float, float]:
    """The lead's index, d_lead and v_lead of vehicle i."""
    best: int | None = None
    best_gap = math.inf
    for j in range(len(traffic.route)):
        if present[i] and present[j]:
            for gap in lead_gaps(intersection, traffic, i, j):
                if gap < best_gap:
                    best, best_gap = j, gap
    if best is None or best_gap > LEAD_RANGE:
        return None, LEAD_RANGE, LEAD_SPEED
    return best, best_gap, float(traffic.speed[best])
