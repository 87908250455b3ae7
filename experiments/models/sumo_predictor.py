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

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from data.sumo import network as sumo_network
from data.sumo.command import command_of
from data.sumo.places import BENDPLATZ
from experiments.models.from_trajectories import prediction_of_trajectories
from experiments.models.running_sumo import running_sumo
from experiments.models.sumo_vehicles import follow, put
from experiments.models.surviving import surviving
from intersection_env.constants import STEPS
from intersection_env.maps.intersection import Intersection
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic


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
        self._running = ExitStack()
        self._sumo = self._running.enter_context(running_sumo(self._start))
        return self

    def __exit__(self, *_: object) -> None:
        """Ends SUMO."""
        self._running.close()

    def _start(self, folder: Path) -> list[str]:
        self._command = [*command_of(self._network, [], folder), "--collision.action", "none"]
        return self._command

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
        motions = follow(self._sumo, self._network, traffic, STEPS, lambda _: self._sumo.simulationStep())
        return prediction_of_trajectories(traffic, *motions)

    def _restore(self, traffic: Traffic) -> None:
        """Puts the vehicles into an empty SUMO.

        The network is loaded anew: after `loadState` of an empty state the random numbers would go on where they were,
        and the same traffic be predicted otherwise.
        """
        self._sumo.load(self._command[1:])
        is_bicycle = np.isfinite(traffic.max_speed)
        types = ["DEFAULT_BIKETYPE" if one else "DEFAULT_VEHTYPE" for one in is_bicycle]
        put(self._sumo, self._network, traffic, types)
        for id in self._sumo.vehicle.getIDList():
            self._sumo.vehicle.setSpeedFactor(id, 1.0)


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
    made = surviving(_predict, traffics, "traffics")
    return StoredPredictions([replace(one, traffic=own) for one, own in zip(made, traffics, strict=True)])


def _predict(traffics: Sequence[Traffic]) -> list[Prediction]:
    with SumoPredictor() as predictor:
        return [predictor.predict(one) for one in traffics]
