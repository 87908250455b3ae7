"""A prediction from trajectories that something else than our core has computed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import DT, STEPS
from intersection_env.prediction.measures import time_loss
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic

Floats = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]


def prediction_of_trajectories(traffic: Traffic, position: Floats, speed: Floats, present: Flags) -> Prediction:
    """One scenario, with what follows from its trajectories by the measures of our own predictions.

    Args:
        traffic: the vehicles now.
        position: (51, vehicle) along each one's route [m].
        speed: (51, vehicle) [m/s].
        present: (51, vehicle), not yet at its route's end.

    Returns:
        The prediction; `enters` tells who has crossed its stop line, since decisions cannot be seen from outside.
    """
    acceleration = np.diff(speed, axis=0) / np.float32(DT)
    stop_line = np.array([traffic.intersection.routes[route].stop_line for route in traffic.route], np.float32)
    return Prediction(
        traffic=traffic,
        time=np.arange(STEPS + 1, dtype=np.float32) * np.float32(DT),
        position=position[None],
        speed=speed[None],
        acceleration=np.concatenate([acceleration, acceleration[-1:]])[None],
        enters=(position + 0.5 * traffic.length >= stop_line)[None],
        present=present[None],
        time_loss=lost_time(traffic, position, speed, present)[None],
        minimum_distance=np.array([minimum_distance(traffic, position, speed, present)], np.float32),
    )


def lost_time(traffic: Traffic, position: Floats, speed: Floats, present: Flags) -> NDArray[np.float32]:
    """What each vehicle loses until its route's end, or as long as its trajectory lasts [s]: (vehicle,).

    Args:
        traffic: the vehicles at the first step.
        position, speed, present: (time, vehicle), as of `prediction_of_trajectories`, of any duration.
    """
    lost = np.zeros(len(traffic), np.float32)
    for i, route in enumerate(traffic.route):
        inside = slice(0, int(present[:, i].sum()) + 1)  # off the map no time is lost
        x, v = (np.ascontiguousarray(one[inside, i]) for one in (position, speed))
        lost[i] = time_loss(traffic.intersection, int(route), x, v, float(traffic.max_speed[i]))[-1]
    return lost


def minimum_distance(traffic: Traffic, position: Floats, speed: Floats, present: Flags) -> float:
    """The smallest distance between two bodies that can touch, over all steps [m]; infinite where there are none.

    Args:
        traffic, position, speed, present: as of `lost_time`.
    """
    core, nearest = traffic.intersection.core, np.inf
    for x, v, on in zip(position, speed, present, strict=True):
        size = traffic.length[on], traffic.width[on], traffic.max_speed[on]
        closest = _core.closest(core, _core.Traffic(core, traffic.route[on], x[on], v[on], *size))
        nearest = nearest if closest is None else min(nearest, closest[0])
    return nearest
