"""How far predictions are from what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.moments import HORIZONS, Moment
from intersection_env.prediction.measures import time_loss
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    import pandas as pd

POPULATIONS = ("recorded", "extrapolated")


@dataclass(frozen=True)
class ErrorFigures:
    """An error's distribution, as the paper quotes it."""

    rmse: float
    mad: float
    """Median of the absolute error."""
    quantile_80: float
    """80 % quantile of the absolute error."""
    count: int


def error_figures(error: NDArray[np.floating]) -> ErrorFigures:
    """The figures of errors (sample,), in their unit.

    Raises:
        ValueError: no samples.
    """
    if error.size == 0:
        raise ValueError("no samples to take error figures of")
    absolute = np.abs(error.astype(np.float64))
    return ErrorFigures(
        float(np.sqrt(np.mean(absolute**2))),
        float(np.median(absolute)),
        float(np.quantile(absolute, 0.8)),
        int(error.size),
    )


class Forecaster(Protocol):
    """What is evaluated: a `Predictor`, or whoever predicts as it does."""

    @property
    def name(self) -> str:
        """The model's, in tables."""
        ...

    def predict(self, traffic: Traffic, /) -> Prediction:
        """The case in which nobody intervenes, as of `Predictor.predict`."""
        ...


@dataclass(frozen=True, eq=False)
class Errors:
    """What predictions got wrong, a column a vehicle and moment.

    distance: (time, sample) along the route, predicted minus recorded [m]; time_loss: (time, sample), lost since the
    start [s]; both from now to 10 s. scored: (time, sample), a car or truck that is recorded then. recorded: (sample,),
    at the start. recording: (sample,) of str.
    """

    distance: NDArray[np.float64]
    time_loss: NDArray[np.float64]
    scored: NDArray[np.bool_]
    recorded: NDArray[np.bool_]
    recording: NDArray[np.str_]

    def of(self, population: str, step: int) -> NDArray[np.bool_]:
        """(sample,) those of a population that are scored at a step."""
        chosen: NDArray[np.bool_] = self.scored[step] & (self.recorded == (population == "recorded"))
        return chosen


def errors(forecaster: Forecaster, moments: Sequence[Moment]) -> Errors:
    """The errors of all vehicles; those of a moment are predicted jointly.

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to evaluate a predictor on")
    parts = [_errors(forecaster, moment) for moment in moments]
    return Errors(*(np.concatenate([getattr(part, field.name) for part in parts], axis=-1) for field in fields(Errors)))


def distance_error(forecaster: Forecaster, moments: Sequence[Moment]) -> float:
    """Of the distance along the route: root of the mean over the horizons of the mean squared errors [m].

    Scored are cars and trucks that are recorded at the start and at the horizon; one at which nobody is does not count.
    """
    sums, counts = np.zeros(len(HORIZONS)), np.zeros(len(HORIZONS))
    for moment in moments:
        predicted, recorded = forecaster.predict(moment.traffic).position[0], moment.recorded.data
        for h, horizon in enumerate(HORIZONS):
            step = round(horizon / DT)
            error = (predicted[step] - recorded[step])[moment.scored[step] & moment.scored[0]]
            sums[h] += float(np.square(error, dtype=np.float64).sum())
            counts[h] += len(error)
    known = counts > 0
    return float(np.sqrt(np.mean(sums[known] / counts[known])))


def evaluate(forecaster: Forecaster, moments: Sequence[Moment]) -> pd.DataFrame:
    """Errors of the predicted positions and time losses; all vehicles of a moment are predicted jointly.

    Scored are cars and trucks, where they are recorded at the horizon: those recorded at the start too, and in
    rows of their own those extrapolated at the start, which are built from their own future.

    Args:
        forecaster: who predicts.
        moments: as `moments_of` gives them.

    Returns:
        One row a population and horizon that has samples: `model`, `population` ("recorded", "extrapolated"),
        `horizon` [s]; of the distance along the route, `rmse` and `mad` (median of the absolute error) [m]; of
        the time lost since the start, predicted minus recorded, `time_loss_rmse` and `time_loss_q80` (80 %
        quantile of the absolute error) [s]; `count` of samples.

    Raises:
        ValueError: no moments.
    """
    import pandas as pd

    found = errors(forecaster, moments)
    rows = []
    for population in POPULATIONS:
        for horizon in HORIZONS:
            step = round(horizon / DT)
            chosen = found.of(population, step)
            if chosen.any():
                far, late = error_figures(found.distance[step, chosen]), error_figures(found.time_loss[step, chosen])
                figures = (far.rmse, far.mad, late.rmse, late.quantile_80, far.count)
                rows.append((forecaster.name, population, horizon, *figures))
    columns = ["model", "population", "horizon", "rmse", "mad", "time_loss_rmse", "time_loss_q80", "count"]
    return pd.DataFrame(rows, columns=columns)


def _errors(forecaster: Forecaster, moment: Moment) -> Errors:
    traffic, tracks = moment.traffic, moment.tracks()
    prediction = forecaster.predict(traffic)
    lost = np.zeros((STEPS + 1, len(traffic)))
    for i, track in enumerate(tracks):
        part, route, top_speed = moment.future(track), int(traffic.route[i]), float(traffic.max_speed[i])
        truth = time_loss(traffic.intersection, route, track.position[part], track.speed[part], top_speed)
        # off the map no time is lost: the sum ends with the step in which the vehicle leaves it
        inside = slice(0, int(prediction.present[0, :, i].sum()) + 1)
        position, speed = (np.ascontiguousarray(one[0, inside, i]) for one in (prediction.position, prediction.speed))
        predicted = time_loss(traffic.intersection, route, position, speed, top_speed)
        at = np.arange(STEPS + 1)
        lost[:, i] = predicted[np.minimum(at, len(predicted) - 1)] - truth[np.minimum(at, len(truth) - 1)]
    return Errors(
        distance=prediction.position[0].astype(np.float64) - moment.recorded.data,
        time_loss=lost,
        scored=moment.scored,
        recorded=~np.ma.getmaskarray(moment.recorded)[0],
        recording=np.full(len(traffic), moment.scene.recording),
    )
