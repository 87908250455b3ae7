"""Predictions that are told who was recorded to cross first: the errors that are left are not the gap decision's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from intersection_env.evaluation.moments import Moment
from intersection_env.evaluation.recorded_order import recorded_order
from intersection_env.prediction.predictor import Prediction, Predictor
from intersection_env.traffic import Traffic


class OrderHandedIn:
    """A predictor to which the recorded order of each of some moments is handed in, where it is known.

    A predictor refuses an order that contradicts the one in a lane, or what a vehicle can still do. There nothing is
    handed in, and `refused` counts the moments.
    """

    def __init__(self, predictor: Predictor, orders: Mapping[int, NDArray[np.int8]]) -> None:
        """With the orders (pair,) by the `id` of the traffic."""
        self.name = predictor.name
        self.refused = 0
        self._predictor, self._orders = predictor, orders

    @classmethod
    def to(cls, predictors: Sequence[Predictor], moments: Sequence[Moment]) -> list[OrderHandedIn]:
        """These predictors, with the orders of these moments, which must outlive them."""
        orders = {id(moment.traffic): recorded_order(moment)[0] for moment in moments} if predictors else {}
        return [cls(one, orders) for one in predictors]

    def predict(self, traffic: Traffic, /) -> Prediction:
        """As of `Predictor.predict`."""
        try:
            return self._predictor.predict(traffic, self._orders[id(traffic)])
        except ValueError:
            self.refused += 1
            return self._predictor.predict(traffic)
