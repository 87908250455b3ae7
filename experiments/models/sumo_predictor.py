"""SUMO as it comes, as a predictor: what somebody gets who takes a simulator instead of a model.

Recorded vehicles are put into SUMO as they are and drive on by its own defaults, without any of the traits with which
`data.sumo` draws its drivers: vehicle types DEFAULT_VEHTYPE and DEFAULT_BIKETYPE, Krauss' model with its dawdling
(sigma 0.5), SUMO's right of way, Euler steps of 0.2 s, in each of which a driver decides. Two things differ from a bare
SUMO: speedFactor is 1 for everybody, not drawn, and a bicycle keeps the top speed that the traffic gives it. The
network is the project's, with its speeds in curves and its distances at which a foe is seen. On simulated recordings
SUMO plays at home: they were made by its models on this network, only with other drivers.

libsumo crashes now and then, so `predictions` runs it in a process of its own.
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.sumo import network as sumo_network
from data.sumo.command import command_of
from data.sumo.places import BENDPLATZ
from experiments.models.from_trajectories import prediction_of_trajectories
from intersection_env.constants import STEPS
from intersection_env.maps.intersection import Intersection
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic

CHUNK = 100  # traffics that are done again after a crash
TRIES = 3  # of a chunk

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]


class SumoPredictor:
    """Predicts Bendplatz by libsumo, while the context lasts; one at a time in a process."""

    name = "sumo"

    def __init__(self) -> None:
        """Prepares the network; SUMO starts with the context."""
        self._intersection = Intersection.load(BENDPLATZ.map)
        _, self._network = sumo_network.read()

    def __enter__(self) -> SumoPredictor:
        """Starts SUMO.

        Raises:
            ModuleNotFoundError: libsumo is not installed.
            RuntimeError: libsumo is already running in this process.
        """
        try:
            self._sumo: Any = importlib.import_module("libsumo")
        except ModuleNotFoundError:
            raise ModuleNotFoundError("sumo is not installed: pip install -e '.[sumo]'") from None
        if self._sumo.isLoaded():
            raise RuntimeError("libsumo is already running in this process, and there can be only one")
        self._folder = tempfile.TemporaryDirectory()
        self._command = [*command_of(self._network, [], Path(self._folder.name)), "--collision.action", "none"]
        self._sumo.start(self._command)
        return self

    def __exit__(self, *_: object) -> None:
        """Ends SUMO."""
        self._sumo.close()
        self._folder.cleanup()

    def predict(self, traffic: Traffic) -> Prediction:
        """The next 10 s, one scenario: the same for the same traffic, whatever was predicted before.

        In it `enters` means that the front has reached the stop line. A vehicle is no longer present, and stays where
        it was seen last, once SUMO has taken it out because its front is at the route's end.

        Raises:
            ValueError: traffic on another map.
        """
        if traffic.intersection != self._intersection:
            raise ValueError(f"traffic is on {traffic.intersection}, SUMO on {self._intersection}")
        self._restore(traffic)
        vehicle, routes = self._sumo.vehicle, [traffic.intersection.routes[route].id for route in traffic.route]
        position, speed = (np.tile(one, (STEPS + 1, 1)) for one in (traffic.position, traffic.speed))
        present = np.zeros(position.shape, np.bool_)
        present[0] = True
        for step in range(STEPS + 1):
            if step:
                self._sumo.simulationStep()
            for id in vehicle.getIDList():
                i = int(id)
                begin, scale = self._network.arcs[routes[i], vehicle.getLaneID(id)]
                position[step:, i] = begin + scale * vehicle.getLanePosition(id) - 0.5 * traffic.length[i]
                speed[step:, i] = scale * vehicle.getSpeed(id)
                present[step, i] = True
        return prediction_of_trajectories(traffic, position, speed, present)

    def _restore(self, traffic: Traffic) -> None:
        """Puts the vehicles, named by their indices, into an empty SUMO.

        The network is loaded anew: after `loadState` lanes that were occupied before stay asleep, and the random
        numbers go on where they were. A vehicle whose front is beyond its route's end has no place in SUMO.
        """
        vehicle = self._sumo.vehicle
        self._sumo.load(self._command[1:])
        for i in range(len(traffic)):
            id, route = str(i), traffic.intersection.routes[traffic.route[i]]
            front = float(traffic.position[i] + 0.5 * traffic.length[i])
            if front >= route.length:
                continue
            is_bicycle = np.isfinite(traffic.max_speed[i])
            vehicle.add(id, route.id, typeID="DEFAULT_BIKETYPE" if is_bicycle else "DEFAULT_VEHTYPE")
            vehicle.setSpeedFactor(id, 1.0)
            vehicle.setLength(id, float(traffic.length[i]))
            vehicle.setWidth(id, float(traffic.width[i]))
            if is_bicycle:
                vehicle.setMaxSpeed(id, float(traffic.max_speed[i]))
            lane, begin, scale = self._lane_at(route.id, front)
            vehicle.moveTo(id, lane, (front - begin) / scale)
            vehicle.setPreviousSpeed(id, float(traffic.speed[i]) / scale, 0.0)

    def _lane_at(self, route: str, front: float) -> tuple[str, float, float]:
        """SUMO's lane where a front is on a route; where the lane begins [m], and metres of route per metre of it."""
        arcs = self._network.arcs.items()
        reached = [(lane, begin, scale) for (of, lane), (begin, scale) in arcs if of == route and begin <= front]
        return reached[-1]


class StoredPredictions:
    """Predictions made before, looked up by their traffic (the object, not its values)."""

    name = SumoPredictor.name

    def __init__(self, found: Sequence[Prediction]) -> None:
        """Keeps these."""
        self._by_traffic = {one.traffic: one for one in found}

    def predict(self, traffic: Traffic) -> Prediction:
        """The one of this traffic.

        Raises:
            KeyError: there is none.
        """
        if traffic not in self._by_traffic:
            raise KeyError(f"this traffic is none of the {len(self._by_traffic)} that were predicted")
        return self._by_traffic[traffic]


def predictions(traffics: Sequence[Traffic]) -> StoredPredictions:
    """What SUMO predicts for these, made in another process; what a crash takes along is made again.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        RuntimeError: SUMO crashed again and again at the same place.
    """
    found: list[Prediction] = []
    crashes = 0
    while len(found) < len(traffics):
        try:
            with ProcessPoolExecutor(1, get_context("spawn")) as process:
                while len(found) < len(traffics):
                    part = traffics[len(found) : len(found) + CHUNK]
                    made = process.submit(_predict, part).result()
                    found += [replace(one, traffic=own) for one, own in zip(made, part, strict=True)]
                    crashes = 0
        except BrokenProcessPool:
            crashes += 1
            if crashes == TRIES:
                raise RuntimeError(f"libsumo crashed {TRIES} times at traffics {len(found)} and on") from None
    return StoredPredictions(found)


def _predict(traffics: Sequence[Traffic]) -> list[Prediction]:
    with SumoPredictor() as predictor:
        return [predictor.predict(one) for one in traffics]
