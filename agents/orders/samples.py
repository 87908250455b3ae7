"""Recorded moments as what an order network learns from: its features, all feasible orders, and which came true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intersection_env.evaluation.moments import EVERY, contested
from intersection_env.evaluation.places import moments_in
from intersection_env.evaluation.recorded_order import scored_order
from intersection_env.prediction.maneuvers import crossing_orders
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

MOST_ORDERS = 512  # ours: of a moment to learn from; 1 in 100 has more


@dataclass(frozen=True, eq=False)
class OrderSample:
    """One moment.

    features: (pair, 21) float32, `ORDER_FEATURES`.
    orders: (order, pair) int8, all that are feasible.
    recorded: (pair,) int8, +1 where the yielder came first, -1 where the prioritized vehicle did, 0 where that is not
        known, or one of them is a bicycle.
    """

    features: NDArray[np.float32]
    orders: NDArray[np.int8]
    recorded: NDArray[np.int8]

    @property
    def possible(self) -> NDArray[np.bool_]:
        """(order,), those that agree with the recording."""
        agrees: NDArray[np.bool_] = ((self.orders == self.recorded) | (self.recorded == 0) | (self.orders == 0)).all(
            axis=1
        )
        return agrees


def order_samples(
    scenes: Scenes | Sequence[Scenes], split: str, every: float = EVERY
) -> tuple[list[OrderSample], dict[str, int]]:
    """The moments with an open pair whose order is known, and how many were left out, by reason.

    Raises:
        ValueError: there is none.
    """
    observer = Predictor.load("idm")  # features depend on no policy
    left_out = {"no order is known": 0, "more orders than learned from": 0, "what was recorded is not feasible": 0}
    samples = []
    for moment in contested(moments_in(scenes, split, every)[0]):
        traffic = moment.traffic
        known, _ = scored_order(moment)
        orders = next(crossing_orders(traffic, batch=MOST_ORDERS + 1), np.zeros((0, len(known)), np.int8))
        features = observer.bound_to(traffic.intersection).observe_orders(traffic.core)
        sample = OrderSample(features, orders, known)
        if not known.any():
            left_out["no order is known"] += 1
        elif len(orders) > MOST_ORDERS:
            left_out["more orders than learned from"] += 1
        elif not sample.possible.any():
            left_out["what was recorded is not feasible"] += 1
        else:
            samples.append(sample)
    if not samples:
        raise ValueError(f'no moment of split "{split}" with an open pair of which it is known who went first')
    return samples, left_out
