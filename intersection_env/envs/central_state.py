"""The whole closed loop as one row of numbers, for critics that see what no agent sees."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.envs.spaces import ROUNDING
from intersection_env.maps.intersection import XY, Intersection, Sample
from intersection_env.worlds.closed_loop import ClosedLoopWorlds

BODY = ("x", "y", "heading", "length", "width")
"""What stands before the features of each vehicle: [m], [m], [rad], [m], [m]."""


def central_state(worlds: ClosedLoopWorlds, observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """The only world's vehicles in one row, of each its body, then what it observes; observation: (vehicle, 12).

    Whoever has backed out of the map is where its route begins.
    """
    state = worlds.state()
    pose = worlds.intersection.sample_each(state["route"][0], state["position"][0])[:, : Sample.HEADING + 1]
    heading = pose[:, Sample.HEADING]  # along a route it goes on beyond a half turn
    heading[:] = (heading + math.pi) % (2.0 * math.pi) - math.pi
    size = np.stack((state["length"][0], state["width"][0]), axis=1)
    return np.concatenate((pose, size, observation), axis=1).ravel()


def central_state_space(intersection: Intersection, vehicles: int, observations: Box[np.float32]) -> Box[np.float32]:
    """What `central_state` can be, of so many vehicles with such observations."""
    places = np.concatenate([route.samples[:, XY] for route in intersection.routes])
    largest = (_core.MOST_LENGTH, _core.MOST_WIDTH)
    low = np.concatenate((places.min(axis=0) - ROUNDING, (-math.pi, 0.0, 0.0), observations.low))
    high = np.concatenate((places.max(axis=0) + ROUNDING, (math.pi, *largest), observations.high))
    return Box(np.tile(low, vehicles).astype(np.float32), np.tile(high, vehicles).astype(np.float32), dtype=np.float32)
