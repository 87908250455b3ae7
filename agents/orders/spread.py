"""How far drivers are from where a policy predicts them under the order that came true."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import DT
from intersection_env.evaluation.moments import followed
from intersection_env.evaluation.places import moments_in
from intersection_env.evaluation.recorded_order import recorded_order
from intersection_env.policies.file import PolicyFile, Spread
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

EVERY = 2.0  # [s] ours: between two moments
LEVELS = np.arange(1, _core.SPREAD_LEVELS + 1) / (_core.SPREAD_LEVELS + 1)
WITHIN = (0.1, 0.9)  # ours: of the distances, from whose difference their scale is taken
DEVIATIONS = 2.563  # so many deviations of a normal error lie between these
LEAST_WEIGHT = 20.0  # ours: of the distances about a knot; with fewer, the next knot's scale holds
LEAST_SCALE = 0.05  # [m] ours


def spread_of(policy: PolicyFile, scenes: Scenes | Sequence[Scenes], split: str = "development") -> Spread:
    """The spread of who drives by this policy, in scenes that it has not learned from.

    Raises:
        ValueError: nobody is recorded long enough in these scenes.
    """
    second, way, distance = _distances(Predictor(policy, "spread"), scenes, split)
    if not len(distance):
        raise ValueError(f'nobody to measure a spread by in the scenes of split "{split}"')
    knots = np.array(_core.spread_ways())
    scales, shapes = [], []
    for k in _seconds():
        own = second == k
        scale = _scales(way[own], distance[own], knots)
        unit = distance[own] / np.interp(way[own], knots, scale)
        scales.append(scale)
        shapes.append(np.quantile(unit, LEVELS) if len(unit) else np.zeros(len(LEVELS)))
    return Spread(np.array(scales, np.float32), np.array(shapes, np.float32))


def _seconds() -> range:
    return range(1, _core.SPREAD_SECONDS + 1)


def _distances(
    predictor: Predictor, scenes: Scenes | Sequence[Scenes], split: str
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Seconds ahead, predicted way until then and recorded minus predicted position [m], of each sighting.

    Left out is who takes part in a pair whose order is not known, and moments whose recorded order is refused.
    """
    seconds, ways, distances = [np.zeros(0, np.int64)], [np.zeros(0)], [np.zeros(0)]
    for moment in followed(moments_in(scenes, split, EVERY)[0]):
        order, _ = recorded_order(moment)
        try:
            position = predictor.predict(moment.traffic, order[None]).position[0]
        except ValueError:
            continue
        known = np.ones(len(moment.traffic), np.bool_)
        known[moment.traffic.conflicts[order == 0]] = False
        for second in _seconds():
            step = round(second / DT)
            seen = np.flatnonzero(moment.scored[0] & moment.scored[step] & known)
            seconds.append(np.full(len(seen), second))
            ways.append((position[step] - position[0])[seen].astype(np.float64))
            distances.append((moment.recorded.data[step] - position[step])[seen].astype(np.float64))
    return np.concatenate(seconds), np.concatenate(ways), np.concatenate(distances)


def _scales(way: NDArray[np.float64], distance: NDArray[np.float64], knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """The scale at each knot [m], from the distances about it: the nearer, the more they count."""
    scales = np.full(len(knots), np.nan)
    for k in range(len(knots)):
        hat = np.zeros(len(knots))
        hat[k] = 1.0
        weight = np.interp(way, knots, hat)
        if weight.sum() >= LEAST_WEIGHT:
            ends = np.quantile(distance, WITHIN, weights=weight, method="inverted_cdf")
            scales[k] = max((ends[1] - ends[0]) / DEVIATIONS, LEAST_SCALE)
    there = np.flatnonzero(~np.isnan(scales))
    if not len(there):
        return np.full(len(knots), LEAST_SCALE)
    nearest = there[np.abs(np.arange(len(knots))[:, None] - there).argmin(axis=1)]
    found: NDArray[np.float64] = scales[nearest]
    return found
