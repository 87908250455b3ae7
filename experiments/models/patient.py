"""Drivers who keep their patience: the median as a predictor, and what many that are drawn say of crossing orders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic

PATIENT = "patience_kept"
DRAWS = 64


def patient(predictor: Predictor) -> Predictor:
    """The same, with patience kept; its name has an ending.

    Raises:
        ValueError: no network decides about gaps.
    """
    return Predictor(predictor.policy, f"{predictor.name}_{PATIENT}", predictor.threads, patience="kept")


def drawn_yielder_first(
    predictor: Predictor, traffic: Traffic, draws: int = DRAWS, seed: int = 0
) -> NDArray[np.float64]:
    """How often the yielder of each pair goes first where every driver's patience is drawn: (pair,).

    The levels of a vehicle are spread evenly over its draws. Who has not gone within the horizon is half first; and
    half a draw is added to either side, as nothing is sure after so few.

    Raises:
        ValueError: no network decides about gaps.
    """
    generator = np.random.default_rng(seed)
    even = np.tile((np.arange(draws) + 0.5) / draws, (len(traffic), 1))
    first = np.zeros(len(traffic.conflicts))
    for levels in generator.permuted(even, axis=1).T:
        one = replace(traffic, patience=predictor.patience_of(traffic, levels))
        order = crossing_order(one, predictor.predict(one))[0]
        first += np.where(order == 0, 0.5, order > 0)
    return (first + 0.5) / (draws + 1.0)
