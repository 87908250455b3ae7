"""In which order vehicles crossed in a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import STEPS
from intersection_env.evaluation.moments import SCORED, Moment


def recorded_order(moment: Moment) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Who reached each conflict first in the recording, and after how many steps the first of the two did.

    A vehicle whose track has ended can be anywhere from there to its route's end. So an order is known where it is the
    same whether the one stayed and the other jumped, or the other way round.

    Returns:
        (pair,) as `crossing_order`, but 0 also where the order is not known; and (pair,), of no meaning there.
    """
    traffic, core_map = moment.traffic, moment.traffic.intersection.core
    stayed, tracked = _positions(moment)
    jumped = np.repeat(stayed[None], len(traffic), axis=0)  # in scenario k, vehicle k alone
    for k, route in enumerate(traffic.route.tolist()):
        jumped[k, ~tracked[:, k], k] = traffic.intersection.routes[route].length
    order = _core.crossing_order(core_map, traffic.core, jumped)
    pair = np.arange(len(traffic.conflicts))
    one, other = (order[traffic.conflicts[:, side], pair] for side in (0, 1))
    time = np.arange(STEPS + 1)
    until = stayed[np.minimum(time[:, None], time)]  # in scenario k, nobody moves after step k
    reached = _core.crossing_order(core_map, traffic.core, until) != 0
    return np.where(one == other, one, np.int8(0)), reached.argmax(axis=0)


def scored_order(moment: Moment) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """As `recorded_order`, but 0 for pairs with a bicycle: they take part, but are not scored."""
    users = np.array([track.road_user in SCORED for track in moment.tracks()], np.bool_)
    order, steps = recorded_order(moment)
    return np.where(users[moment.traffic.conflicts].all(axis=1), order, np.int8(0)), steps


def _positions(moment: Moment) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(time, vehicle) as recorded, at a standstill after a track's end [m]; and whether the track lasts till then."""
    position = np.zeros((STEPS + 1, len(moment.traffic)), np.float32)
    tracked = np.zeros(position.shape, np.bool_)
    for i, track in enumerate(moment.tracks()):
        own = track.position[moment.future(track)]
        position[: len(own), i], position[len(own) :, i] = own, own[-1]
        tracked[: len(own), i] = True
    return position, tracked
