"""What a forecast of one moment, seen with errors, got right; and what many of them come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.measure.perception_choices import Choice
from intersection_env.constants import STEPS
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import Moment
from intersection_env.evaluation.recorded_order import scored_order
from intersection_env.prediction.forecast import Forecast
from intersection_env.prediction.noise import on_pairs

CENTRAL = (0.1, 0.9)  # levels, between which lie 80 %

Floats = NDArray[np.float64]


class Sample(NamedTuple):
    """One moment.

    pairs: (pair, 2) whether each pair's more probable order was the recorded one, and the squared error of its
    probability; those of cars and trucks whose order is known, and who have not reached the conflict. at_10s:
    (vehicle,) errors of the mean position [m]. seen: (vehicle, 2) likewise until last seen, and whether the recorded
    position is in the 80 % interval.
    """

    recording: str
    pairs: Floats
    at_10s: Floats
    seen: Floats
    choice: Choice


def sample_of(moment: Moment, found: Forecast, choice: Choice) -> Sample:
    """What a forecast of the moment's vehicles, seen with errors, got right."""
    order, steps = scored_order(moment)
    _, chance = on_pairs(moment.traffic, found.traffic, found.orders, found.yielder_first)
    chosen = (order != 0) & (steps > 0)
    first, sure = order[chosen] > 0, chance[chosen]
    mean, recorded = found.mean_position(), moment.recorded.data.astype(np.float64)
    low, high = found.position_quantiles(CENTRAL).astype(np.float64)
    then = moment.scored[0] & moment.scored[STEPS]
    last = moment.last_seen()
    who = np.flatnonzero(~np.ma.getmaskarray(last))
    at = last.data[who], who
    held = (low[at] <= recorded[at]) & (recorded[at] <= high[at])
    return Sample(
        moment.scene.recording,
        np.stack([(sure > 0.5) == first, np.square(sure - first)], axis=1).astype(np.float64),
        mean[STEPS, then] - recorded[STEPS, then],
        np.stack([mean[at] - recorded[at], held], axis=1),
        choice,
    )


def figures_of(samples: Sequence[Sample]) -> dict[str, Any]:
    """Figures with intervals over recordings; None where there is nothing to score.

    Returns:
        Of the pairs `accuracy` and `brier`; of the mean position `rmse_10s`, `mad_10s`, `rmse_seen`, `mad_seen` [m]
        (MAD: median of the absolute error) and `coverage_seen` of the 80 % interval; of the choice `same`, `refused`,
        `unsafe` and `regret` [s], as of `Choice`.
    """

    def over(rows: Callable[[Sample], Floats], statistic: Callable[[Floats], float]) -> dict[str, float] | None:
        by_recording: dict[str, list[Floats]] = {}
        for sample in samples:
            by_recording.setdefault(sample.recording, []).append(rows(sample))
        joined = {name: np.concatenate(by_recording[name]) for name in sorted(by_recording)}
        return interval(joined, statistic) if any(map(len, joined.values())) else None

    choices = {
        name: over(lambda one, name=name: np.array([getattr(one.choice, name)], np.float64), np.mean)  # type: ignore[misc]
        for name in Choice._fields
    }
    return {
        "accuracy": over(lambda one: one.pairs[:, 0], np.mean),
        "brier": over(lambda one: one.pairs[:, 1], np.mean),
        "rmse_10s": over(lambda one: one.at_10s, _rmse),
        "mad_10s": over(lambda one: one.at_10s, _mad),
        "rmse_seen": over(lambda one: one.seen[:, 0], _rmse),
        "mad_seen": over(lambda one: one.seen[:, 0], _mad),
        "coverage_seen": over(lambda one: one.seen[:, 1], np.mean),
        **choices,
    }


def _rmse(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _mad(values: Floats) -> float:
    return float(np.median(np.abs(values)))
