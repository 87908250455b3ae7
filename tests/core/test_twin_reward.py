"""The twin by hand: when the penalties of the reward violate a constraint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.closed_loop import State
from tests.reference.starts import violations
from tests.reference.traffic import BRAKING, speed_limit
from tests.support.placing import T_JUNCTION, place


@pytest.mark.parametrize(
    ("too_fast", "too_near", "violates"),
    [(0.0, 0.0, False), (0.8e-3, 0.0, False), (0.0, 0.8e-3, False), (0.8e-3, 0.8e-3, True), (1.2e-3, 0.0, True)],
)
def test_penalties_violate_a_constraint_where_their_sum_does(too_fast: float, too_near: float, violates: bool) -> None:
    """Of a vehicle that pays so much for its speed, and so much for the lead that it could not brake behind."""
    traffic = place(T_JUNCTION, ("W-E", 100, 0), ("W-E", 60, 0))
    limit = speed_limit(T_JUNCTION, traffic, 0)
    speed = limit + too_fast * limit / 30
    gap = speed**2 / (2 * BRAKING) - too_near / 30
    traffic = replace(
        traffic,
        position=traffic.position[0] + np.array([0.0, gap + 4.0]),  # both are 4 m long
        speed=np.array([speed, limit]),
    )
    found = violations(T_JUNCTION, State(traffic, np.ones(2, np.bool_), np.full(2, -1)))
    assert [line.partition(":")[0] for line in found] == (["vehicle 0"] if violates else [])
