"""Where everybody may be: quantiles over orders, and over what drivers do within one."""

import numpy as np

from tests.reference.intersection import Floats
from tests.reference.traffic import TIME_STEP

WAYS = (0.0, 5.0, 15.0, 40.0, 80.0)  # m, predicted until then, at which there is a scale


def distances(scale: Floats, shape: Floats, time: float, way: float) -> Floats:
    """(level,) [m]: how far a driver may be from where it is predicted to be after so many seconds and metres.

    scale: (second, way); shape: (second, level), in units of the scale.
    """
    seconds = range(len(scale) + 1)
    at_seconds = [np.zeros(shape.shape[1])]
    at_seconds += [np.interp(way, WAYS, of_ways) * levels for of_ways, levels in zip(scale, shape, strict=True)]
    return np.array([np.interp(time, seconds, of_level) for of_level in np.array(at_seconds).T])


def position_quantiles(scale: Floats, shape: Floats, probability: Floats, position: Floats, levels: Floats) -> Floats:
    """(level, time, vehicle) [m], of orders' probabilities (order,) and positions (order, time, vehicle)."""
    orders, steps, vehicles = position.shape
    result = np.zeros((len(levels), steps, vehicles))
    for step in range(steps):
        for i in range(vehicles):
            places = []
            for order in range(orders):
                now, then = position[order, 0, i], position[order, step, i]
                for distance in distances(scale, shape, step * TIME_STEP, then - now):
                    places.append((max(then + distance, now), probability[order]))
            place, weight = np.array(sorted(places)).T
            up_to = np.cumsum(weight)
            for number, level in enumerate(levels):
                result[number, step, i] = place[np.flatnonzero(up_to >= level * up_to[-1] * (1.0 - 1e-12))[0]]
    return result
