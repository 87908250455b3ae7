"""The closed loop obeys all-way stops and roundabouts: driven by the IDM, nobody cuts anybody."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection
from intersection_env.constants import ACCELERATION
from intersection_env.features import Driving
from tests.reference.drive import Idm, idm
from tests.support.worlds_cases import Arrays, closed_loop

STEPS = 400
PARAMETERS = Idm()


def actions(observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """What the IDM does at what each vehicle sees (world, vehicle, feature), with a stop line where it must wait."""
    result = np.zeros(observation.shape[:2], np.float32)
    for place in np.ndindex(result.shape):
        seen = observation[place].astype(np.float64)
        speed, free = float(seen[Driving.SPEED]), float(seen[Driving.V_MAX])
        wanted = idm(speed, free, float(seen[Driving.LEAD_DISTANCE]), float(seen[Driving.LEAD_SPEED]), PARAMETERS)
        if seen[Driving.ENTERS] == 0.0:
            wanted = min(wanted, idm(speed, free, float(seen[Driving.DISTANCE_TO_STOP_LINE]), 0.0, PARAMETERS))
        wanted = max(wanted, -speed / 0.2)
        result[place] = np.clip(wanted / ACCELERATION, -1.0, 1.0)
    return result


def driven(name: str, gap: str, vehicles: int) -> tuple[list[Arrays], int, int]:
    """The states of some worlds, step by step; how many vehicles left, and how many were to blame."""
    loop = closed_loop(name, 4, vehicles, gap=gap, autoreset="same_step")
    loop.reset(0, False)
    states, left, blamed = [loop.state()], 0, 0
    for _ in range(STEPS):
        loop.action[:] = actions(loop.observation)
        loop.step()
        left += int(loop.reinserted.sum())
        blamed += int(loop.terminated.sum())
        states.append(loop.state())
    return states, left, blamed


def crossing(intersection: Intersection, one: Arrays, other: Arrays) -> list[tuple[int, int]]:
    """(world, vehicle): who crosses its line between two states."""
    lines = np.array([route.stop_line for route in intersection.routes])
    before, after = (lines[s["route"]] - s["position"] - s["length"] / 2 for s in (one, other))
    same = (one["route"] == other["route"]) & (one["length"] == other["length"]) & ~one["done"][:, None]
    return list(zip(*np.nonzero(same & (before >= 0.0) & (after < 0.0)), strict=True))


@pytest.mark.parametrize("gap", ["critical_gap", "sumo", "network"])
def test_all_way_stop_clears_in_order_of_arrival_and_after_a_stop(gap: str) -> None:
    intersection = Intersection.load("all_way_stop")
    meets = {frozenset((c.yielder, c.prioritized)) for c in intersection.conflicts}
    lines = np.array([route.stop_line for route in intersection.routes])
    states, left, blamed = driven("all_way_stop", gap, 6)
    crossed, could_not_stop = 0, states[0]["delta"]
    for one, other in pairwise(states):
        for world, vehicle in crossing(intersection, one, other):
            if could_not_stop[world, vehicle]:  # as its world began
                continue
            crossed += 1
            assert one["waited"][world, vehicle] > 0, "it has made its stop"
            to_line = lines[one["route"][world]] - one["position"][world] - one["length"][world] / 2
            for foe in np.flatnonzero(to_line >= 0.0):
                pair = frozenset((int(one["route"][world, vehicle]), int(one["route"][world, foe])))
                if pair in meets:
                    assert one["waited"][world, foe] <= one["waited"][world, vehicle], "first come, first served"
        could_not_stop = could_not_stop & (other["position"] >= one["position"]) & (other["cycle"] > 0)[:, None]
        could_not_stop |= other["delta"] & (other["cycle"] == 0)[:, None]
    assert crossed > 60
    assert left > 40
    assert blamed == 0


@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_circulating_vehicles_are_never_cut(gap: str) -> None:
    _, left, blamed = driven("roundabout", gap, 6)
    assert left > 40
    assert blamed == 0


@pytest.mark.parametrize(
    ("name", "is_plain"),
    [("bendplatz", True), ("crossroads", True), ("t_junction", True), ("roundabout", False), ("all_way_stop", False)],
)
def test_maps_on_which_routes_meet_once_take_the_short_rows(name: str, is_plain: bool) -> None:
    assert closed_loop(name, 1, 2).is_plain is is_plain
