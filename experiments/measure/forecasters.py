"""Forecasts as single predictions, so that they stand in the tables beside those of other models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from intersection_env.prediction.forecast import forecast
from intersection_env.prediction.predictor import Prediction, Predictor
from intersection_env.traffic import Traffic

MOST_PROBABLE, MEAN = "most_probable", "mean_over_orders"
EVERYTHING = 0.999  # of the probability, as far as `MOST` orders go


class MostProbableOrder:
    """The prediction of the most probable crossing order."""

    def __init__(self, predictor: Predictor) -> None:
        """By this predictor, whose name it has with an ending."""
        self.name = f"{predictor.name}_{MOST_PROBABLE}"
        self._predictor = predictor

    def predict(self, traffic: Traffic, /) -> Prediction:
        """As of `Predictor.predict`."""
        return forecast(self._predictor, traffic, most=1).prediction


class MeanOverOrders:
    """The mean of the predictions of the most probable orders, by their probabilities; nobody need drive like that."""

    def __init__(self, predictor: Predictor) -> None:
        """By this predictor, whose name it has with an ending."""
        self.name = f"{predictor.name}_{MEAN}"
        self._predictor = predictor

    def predict(self, traffic: Traffic, /) -> Prediction:
        """As of `Predictor.predict`; flags are those of the most probable order."""
        found = forecast(self._predictor, traffic, mass=EVERYTHING)
        each = found.prediction

        def mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
            over: NDArray[np.float64] = np.tensordot(found.weight, values.astype(np.float64), axes=1)
            return over.astype(np.float32)[None]

        return replace(
            each,
            position=mean(each.position),
            speed=mean(each.speed),
            acceleration=mean(each.acceleration),
            time_loss=mean(each.time_loss),
            enters=each.enters[:1],
            present=each.present[:1],
            minimum_distance=each.minimum_distance[:1],
            hold=None,
            priorities=None,
        )
