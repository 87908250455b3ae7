"""Traffic whose vehicles remember something."""

from __future__ import annotations

from typing import Any

import numpy as np

from intersection_env import Traffic
from tests.reference import predictor as reference


def remembering(traffic: Traffic, delta: Any, hold: Any) -> Traffic:
    """The same vehicles with these memories."""
    columns = (traffic.route, traffic.position, traffic.speed, traffic.length, traffic.width, traffic.max_speed)
    return Traffic(traffic.intersection, traffic.ids, *columns, delta, hold)


def with_random_memories(traffic: Traffic, generator: np.random.Generator) -> Traffic:
    """The same vehicles with any memories that there can be."""
    hold = generator.integers(-1, len(traffic.intersection.routes) + 1, len(traffic)).astype(np.int16)
    return remembering(traffic, generator.integers(0, 2, len(traffic)).astype(np.bool_), hold)


def memory_of(traffic: Traffic) -> reference.Memory:
    """The memories as the twin has them; everybody is present."""
    assert traffic.delta is not None
    assert traffic.hold is not None
    return reference.Memory(np.ones(len(traffic), np.bool_), traffic.delta, traffic.hold.astype(np.int64))
