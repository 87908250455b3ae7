"""What a motion costs and who crosses first: time loss, crossing order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection, Sample
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic


def time_loss(
    intersection: Intersection,
    route: int,
    position: NDArray[np.float32],
    speed: NDArray[np.float32],
    max_speed: float = np.inf,
) -> NDArray[np.float64]:
    """Cumulated time loss of one vehicle, (time,): at entry k over the k steps before; paper, Eq. (5).

    Args:
        route: the vehicle's route index.
        position, speed: (time,) at steps of 0.2 s [m], [m/s].
        max_speed: the vehicle's own top speed [m/s].
    """
    v_max = np.minimum(intersection.sample(route, np.ascontiguousarray(position))[:, Sample.V_MAX], max_speed)
    lost = DT * (1.0 - speed.astype(np.float64) / v_max)
    return np.concatenate([[0.0], np.cumsum(lost[:-1])])


def crossing_order(traffic: Traffic, prediction: Prediction) -> NDArray[np.int8]:
    """Who reached each conflict first: (scenario, pair), +1 the yielder, -1 the prioritized vehicle, 0 neither yet.

    A vehicle reaches a conflict when its front bumper is where the other route's swept area begins.
    """
    return _core.crossing_order(traffic.intersection.core, traffic.core, prediction.position)


def first_time(front: NDArray[np.float32], line: float) -> NDArray[np.float64]:
    """The first time [s] at which `front` (scenario, time) has reached `line` [m]: (scenario,), inf if never."""
    reached = front >= line
    return np.where(reached.any(axis=1), reached.argmax(axis=1) * DT, np.inf)
