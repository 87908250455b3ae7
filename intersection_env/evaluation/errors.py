"""How far predictions are from what was recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.moments import HORIZONS, Moment, last_seen
from intersection_env.prediction.measures import time_loss
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    import pandas as pd

AT_HORIZON = ("recorded", "extrapolated")
"""Populations scored at a horizon at which they are recorded: recorded at the start too (the paper's), or not."""
UNTIL_LAST_SEEN = "until_last_seen"
"""Every car and truck recorded at the start, scored at the last moment within 10 s at which it is recorded."""
LAST_SEEN = "last_seen"
"""Part of it: those last seen within the 2 s up to a horizon."""
SPEEDS = ("speed_behind", "recorded_speed_behind")

Floats = NDArray[np.float64]
MaskedFloats: TypeAlias = np.ma.MaskedArray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class ErrorFigures:
    """An error's distribution, as the paper quotes it, and which way it leans."""

    rmse: float
    mad: float
    """Median of the absolute error."""
    quantile_80: float
    """80 % quantile of the absolute error."""
    bias: float
    """Mean error."""
    count: int


def error_figures(error: NDArray[np.floating]) -> ErrorFigures:
    """The figures of errors (sample,), in their unit.

    Raises:
        ValueError: no samples.
    """
    if error.size == 0:
        raise ValueError("no samples to take error figures of")
    signed = error.astype(np.float64)
    absolute = np.abs(signed)
    return ErrorFigures(
        float(np.sqrt(np.mean(absolute**2))),
        float(np.median(absolute)),
        float(np.quantile(absolute, 0.8)),
        float(signed.mean()),
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
    at the start. behind, recorded_behind: (time, sample) speeds behind the junction [m/s], predicted and recorded,
    after the start; masked where the vehicle's rear is not there by the prediction, or by the recording, where it has
    left the map, and where it is not scored. recording: (sample,) of str.
    """

    distance: Floats
    time_loss: Floats
    scored: NDArray[np.bool_]
    recorded: NDArray[np.bool_]
    behind: MaskedFloats
    recorded_behind: MaskedFloats
    recording: NDArray[np.str_]

    def of(self, population: str, step: int) -> NDArray[np.bool_]:
        """(sample,) those of one of `AT_HORIZON` that are scored at a step."""
        chosen: NDArray[np.bool_] = self.scored[step] & (self.recorded == (population == "recorded"))
        return chosen

    def last_seen(self) -> np.ma.MaskedArray[Any, np.dtype[np.int64]]:
        """(sample,) the step at which each is scored until last seen; masked where it is not of those."""
        return last_seen(self.scored)

    def until_last_seen(self, quantity: str) -> MaskedFloats:
        """(sample,) "distance" or "time_loss" at the moment at which each was last seen; masked likewise."""
        last = self.last_seen()
        of_each: Floats = getattr(self, quantity)
        return np.ma.masked_array(of_each[last.data, np.arange(len(last))], np.ma.getmaskarray(last))

    def seen_up_to(self, horizon: float) -> NDArray[np.bool_]:
        """(sample,) those last seen within the 2 s up to one of the `HORIZONS` [s]."""
        last, step, width = self.last_seen(), round(horizon / DT), round(HORIZONS[0] / DT)
        chosen: NDArray[np.bool_] = ~np.ma.getmaskarray(last) & (step - width < last.data) & (last.data <= step)
        return chosen


def errors(forecaster: Forecaster, moments: Sequence[Moment]) -> Errors:
    """The errors of all vehicles; those of a moment are predicted jointly.

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to evaluate a predictor on")
    parts = [_errors(forecaster, moment) for moment in moments]
    return Errors(**{field.name: _joined([getattr(part, field.name) for part in parts]) for field in fields(Errors)})


def _joined(parts: Sequence[Any]) -> Any:
    masked = isinstance(parts[0], np.ma.MaskedArray)
    return (np.ma.concatenate if masked else np.concatenate)(parts, axis=-1)


def distance_error(forecaster: Forecaster, moments: Sequence[Moment]) -> float:
    """One figure to choose by, those who drive off included [m]: root of the mean over the horizons of the MSE.

    At each horizon all cars and trucks recorded at the start are scored, each at the last moment up to then at which it
    is recorded (1 s later at least); at 10 s this is the mean squared error until last seen. A horizon with nobody to
    score does not count.
    """
    sums, counts = np.zeros(len(HORIZONS)), np.zeros(len(HORIZONS))
    for moment in moments:
        predicted = forecaster.predict(moment.traffic).position[0]
        seen = moment.sightings
        error = predicted[seen.step, seen.vehicle] - seen.position
        sums += np.bincount(seen.horizon, error**2, len(HORIZONS))
        counts += np.bincount(seen.horizon, minlength=len(HORIZONS))
    known = counts > 0
    return float(np.sqrt(np.mean(sums[known] / counts[known])))


def figures_until_last_seen(forecaster: Forecaster, moments: Sequence[Moment]) -> dict[str, float]:
    """What a training says of it: `rmse`, `mad` and `bias` until last seen [m]; and `SPEEDS` of those scored [m/s].

    Where nobody is behind the junction there is no speed. All are rounded to millimetres.

    Raises:
        ValueError: there is nobody to score.
    """
    found = errors(forecaster, moments)
    error, scored = (
        error_figures(found.until_last_seen("distance").compressed()),
        ~np.ma.getmaskarray(found.last_seen()),
    )
    figures = {"rmse": error.rmse, "mad": error.mad, "bias": error.bias}
    for key, speeds in zip(SPEEDS, (found.behind, found.recorded_behind), strict=True):
        if (mean := mean_speed(speeds[:, scored])) is not None:
            figures[key] = mean
    return {key: round(value, 3) for key, value in figures.items()}


def evaluate(forecaster: Forecaster, moments: Sequence[Moment]) -> pd.DataFrame:
    """Errors of the predicted positions and time losses; all vehicles of a moment are predicted jointly.

    Scored are cars and trucks, in four populations:

    - "recorded", the paper's: recorded at the start and at the horizon. These are mostly those who waited; who drives
      off has left the view.
    - "extrapolated": recorded at the horizon and not yet at the start, so built from their own future.
    - "until_last_seen", one row: recorded at the start, each scored at the last moment within the 10 s at which it is
      recorded, which is 1 s later at least.
    - "last_seen": of those the ones that were last seen within the 2 s up to the horizon.

    Args:
        forecaster: who predicts.
        moments: as `moments_of` gives them.

    Returns:
        One row a population and horizon that has samples: `model`, `population`, `horizon` [s]; of the distance along
        the route, predicted minus recorded, `rmse`, `mad` (median of the absolute error) and `bias` (mean) [m]; of the
        time lost since the start, likewise, `time_loss_rmse` and `time_loss_q80` (80 % quantile of the absolute error)
        [s]; `speed_behind` and `recorded_speed_behind`, the mean speeds behind the junction up to the horizon,
        predicted and recorded, each while its own rear is there and the vehicle is recorded [m/s], NA where nobody is;
        `count` of samples.

    Raises:
        ValueError: no moments.
    """
    import pandas as pd

    found = errors(forecaster, moments)
    distance, lost = (found.until_last_seen(quantity) for quantity in ("distance", "time_loss"))
    rows = []
    for population, horizon, chosen in _populations(found):
        if chosen.any():
            step = round(horizon / DT)
            far = error_figures((found.distance[step] if population in AT_HORIZON else distance.data)[chosen])
            late = error_figures((found.time_loss[step] if population in AT_HORIZON else lost.data)[chosen])
            figures = (far.rmse, far.mad, far.bias, late.rmse, late.quantile_80)
            speeds = (mean_speed(one[: step + 1, chosen]) for one in (found.behind, found.recorded_behind))
            rows.append((forecaster.name, population, horizon, *figures, *speeds, far.count))
    columns = ["model", "population", "horizon", "rmse", "mad", "bias", "time_loss_rmse", "time_loss_q80"]
    table = pd.DataFrame(rows, columns=[*columns, *SPEEDS, "count"])
    return table.astype(dict.fromkeys(SPEEDS, "Float64"))


def mean_speed(speeds: MaskedFloats) -> float | None:
    """The mean of those that are known, if any are."""
    return float(speeds.mean()) if speeds.count() else None


def _populations(found: Errors) -> Iterator[tuple[str, float, NDArray[np.bool_]]]:
    """Population, horizon, and who is scored: (sample,)."""
    for population in AT_HORIZON:
        yield from ((population, horizon, found.of(population, round(horizon / DT))) for horizon in HORIZONS)
    yield UNTIL_LAST_SEEN, HORIZONS[-1], ~np.ma.getmaskarray(found.last_seen())
    yield from ((LAST_SEEN, horizon, found.seen_up_to(horizon)) for horizon in HORIZONS)


def _errors(forecaster: Forecaster, moment: Moment) -> Errors:
    traffic, tracks = moment.traffic, moment.tracks()
    prediction = forecaster.predict(traffic)
    lost = np.zeros((STEPS + 1, len(traffic)))
    for i, track in enumerate(tracks):
        part, route, top_speed = moment.future(track), int(traffic.route[i]), float(traffic.max_speed[i])
        truth = time_loss(traffic.intersection, route, track.position[part], track.speed[part], top_speed)
        # off the map no time is lost: the sum ends with the step in which the vehicle leaves it
        inside = slice(0, int(prediction.present[0, :, i].sum()) + 1)
        places, speeds = (np.ascontiguousarray(one[0, inside, i]) for one in (prediction.position, prediction.speed))
        predicted = time_loss(traffic.intersection, route, places, speeds, top_speed)
        at = np.arange(STEPS + 1)
        lost[:, i] = predicted[np.minimum(at, len(predicted) - 1)] - truth[np.minimum(at, len(truth) - 1)]
    position, recorded = prediction.position[0].astype(np.float64), moment.recorded.data
    return Errors(
        distance=position - recorded,
        time_loss=lost,
        scored=moment.scored,
        recorded=~np.ma.getmaskarray(moment.recorded)[0],
        behind=_behind(moment, position, prediction.speed[0].astype(np.float64), prediction.present[0]),
        recorded_behind=_behind(moment, recorded, moment.speed.astype(np.float64), np.ones(recorded.shape, np.bool_)),
        recording=np.full(len(traffic), moment.scene.recording),
    )


def _behind(moment: Moment, position: NDArray[np.floating], speed: Floats, present: NDArray[np.bool_]) -> MaskedFloats:
    """Speeds (time, vehicle) where the rear is behind the junction, of who is scored then; not at the start."""
    traffic = moment.traffic
    exits = np.array([traffic.intersection.routes[route].junction[1] for route in traffic.route])
    behind = (position - traffic.length / 2.0 > exits) & present & moment.scored
    behind[0] = False  # there all predictions are what was recorded
    return np.ma.masked_array(speed, ~behind)
