"""The vehicles of a traffic in libsumo: put where they are, and followed while SUMO drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.sumo.network import Network
from intersection_env.traffic import Traffic


class Motions(NamedTuple):
    """What SUMO has driven, (time, vehicle) each at steps of 0.2 s: position [m] and speed [m/s] along the own route.

    present: not yet taken out because the front is at the route's end; the other values stay as they were there.
    """

    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    present: NDArray[np.bool_]

    def within(self, steps: int) -> Motions:
        """The first so many steps."""
        return Motions(self.position[: steps + 1], self.speed[: steps + 1], self.present[: steps + 1])


def put(sumo: Any, network: Network, traffic: Traffic, types: Sequence[str]) -> None:
    """Puts the vehicles, named by their indices, into a SUMO that is empty; each of the type that is told.

    A bicycle keeps the top speed that the traffic gives it. A vehicle whose front is beyond its route's end has no
    place in SUMO.
    """
    vehicle = sumo.vehicle
    for i in range(len(traffic)):
        id, route = str(i), traffic.intersection.routes[traffic.route[i]]
        front = float(traffic.position[i] + 0.5 * traffic.length[i])
        if front >= route.length:
            continue
        vehicle.add(id, route.id, typeID=types[i])
        vehicle.setLength(id, float(traffic.length[i]))
        vehicle.setWidth(id, float(traffic.width[i]))
        if np.isfinite(traffic.max_speed[i]):
            vehicle.setMaxSpeed(id, float(traffic.max_speed[i]))
        lane, begin, scale = lane_at(network, route.id, front)
        vehicle.moveTo(id, lane, (front - begin) / scale)
        vehicle.setPreviousSpeed(id, float(traffic.speed[i]) / scale, 0.0)


def lane_at(network: Network, route: str, front: float) -> tuple[str, float, float]:
    """SUMO's lane where a front is on a route; where the lane begins [m], and metres of route per metre of it."""
    arcs = network.arcs.items()
    reached = [(lane, begin, scale) for (of, lane), (begin, scale) in arcs if of == route and begin <= front]
    return reached[-1]


def follow(
    sumo: Any, network: Network, traffic: Traffic, steps: int, advance: Callable[[NDArray[np.float32]], None]
) -> Motions:
    """Where the vehicles that were put in go, over so many steps.

    Args:
        sumo: libsumo.
        network: on which it drives.
        traffic: the vehicles now.
        steps: of 0.2 s.
        advance: lets SUMO drive for 0.2 s; it is told the positions now (vehicle,) [m].
    """
    vehicle, routes = sumo.vehicle, [traffic.intersection.routes[route].id for route in traffic.route]
    position, speed = (np.tile(one, (steps + 1, 1)) for one in (traffic.position, traffic.speed))
    present = np.zeros(position.shape, np.bool_)
    present[0] = True
    for step in range(steps + 1):
        if step:
            advance(position[step - 1])
        for id in vehicle.getIDList():
            i = int(id)
            begin, scale = network.arcs[routes[i], vehicle.getLaneID(id)]
            position[step:, i] = begin + scale * vehicle.getLanePosition(id) - 0.5 * traffic.length[i]
            speed[step:, i] = scale * vehicle.getSpeed(id)
            present[step, i] = True
    return Motions(position, speed, present)
