"""How far predictions are from what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from intersection_env.prediction.measures import error_figures, time_loss
from intersection_env.prediction.predictor import DT, STEPS, Prediction
from intersection_env.scenes.scenes import Scene, Scenes, Track
from intersection_env.traffic import Traffic

HORIZONS = (2.0, 4.0, 6.0, 8.0, 10.0)  # [s], paper, Section IV-C
EVERY = 1.0  # [s] ours: between two starts; nearer ones see nearly the same scene
SCORED = ("car", "truck_bus")  # bicycles take part, but are not scored
POPULATIONS = ("recorded", "extrapolated")
_LEAST = round(HORIZONS[0] / DT)


@dataclass(frozen=True, eq=False)
class Start:
    """One recorded moment from which to predict."""

    scene: Scene
    step: int
    traffic: Traffic
    """The vehicles present, in the order of the scene's tracks."""

    @property
    def time(self) -> float:
        """Since the scene's begin [s]."""
        return self.step * DT

    @property
    def full(self) -> bool:
        """Whether the scene lasts for the whole horizon from here."""
        return self.step + STEPS < self.scene.steps

    def recorded(self) -> np.ma.MaskedArray[Any, np.dtype[np.float32]]:
        """The positions as they became: (time, vehicle) [m], masked where not recorded."""
        position = np.zeros((STEPS + 1, len(self.traffic)), np.float32)
        known = np.zeros(position.shape, np.bool_)
        for i, track in enumerate(self.tracks()):
            part = self.future(track)
            count = len(track.position[part])
            position[:count, i], known[:count, i] = track.position[part], track.observed[part]
        return np.ma.masked_array(position, ~known)

    def tracks(self) -> list[Track]:
        """The tracks of the vehicles present: (vehicle,)."""
        return [self.scene.track(id) for id in self.traffic.ids]

    def future(self, track: Track) -> slice:
        """Where in a track's arrays this moment and the horizon after it lie."""
        return slice(self.step - track.start, self.step - track.start + STEPS + 1)


def starts(scenes: Scenes) -> tuple[list[Start], dict[str, str]]:
    """Every second of every scene, as long as 2 s of it remain and anybody is there.

    Returns:
        The starts, and those refused because vehicles overlap in the recording: what was found, by moment.
    """
    found: list[Start] = []
    refused: dict[str, str] = {}
    for scene in scenes:
        for step in range(0, scene.steps - _LEAST, round(EVERY / DT)):
            try:
                traffic = scenes.at(scene, step * DT)
            except ValueError as error:
                refused[f"scene {scene.id}, {step * DT:.1f} s"] = str(error)
                continue
            if len(traffic):
                found.append(Start(scene, step, traffic))
    return found, refused


def contested(moments: Sequence[Start]) -> list[Start]:
    """Those with an open conflict."""
    return [start for start in moments if len(start.traffic.conflicts)]


def thinned(moments: Sequence[Start], most: int) -> list[Start]:
    """At most so many of the moments, evenly spread over them.

    Raises:
        ValueError: `most` is below 1.
    """
    if most < 1:
        raise ValueError(f"the number of moments must be at least 1, not {most}")
    places = np.linspace(0, len(moments) - 1, min(most, len(moments))).round().astype(np.int64)
    return [moments[place] for place in places.tolist()]


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
    """What predictions got wrong, a column a vehicle and start.

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


def errors(forecaster: Forecaster, moments: Sequence[Start]) -> Errors:
    """The errors of all vehicles; those of a start are predicted jointly.

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to evaluate a predictor on")
    parts = [_errors(forecaster, start) for start in moments]
    return Errors(*(np.concatenate([getattr(part, field.name) for part in parts], axis=-1) for field in fields(Errors)))


def evaluate(forecaster: Forecaster, moments: Sequence[Start]) -> pd.DataFrame:
    """Errors of the predicted positions and time losses; all vehicles of a start are predicted jointly.

    Scored are cars and trucks, where they are recorded at the horizon: those recorded at the start too, and in
    rows of their own those extrapolated at the start, which are built from their own future.

    Args:
        forecaster: who predicts.
        moments: as `starts` gives them.

    Returns:
        One row a population and horizon that has samples: `model`, `population` ("recorded", "extrapolated"),
        `horizon` [s]; of the distance along the route, `rmse` and `mad` (median of the absolute error) [m]; of
        the time lost since the start, predicted minus recorded, `time_loss_rmse` and `time_loss_q80` (80 %
        quantile of the absolute error) [s]; `count` of samples.

    Raises:
        ValueError: no moments.
    """
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


def _errors(forecaster: Forecaster, start: Start) -> Errors:
    traffic, tracks = start.traffic, start.tracks()
    prediction = forecaster.predict(traffic)
    recorded = start.recorded()
    known = ~np.ma.getmaskarray(recorded)
    lost = np.zeros((STEPS + 1, len(traffic)))
    for i, track in enumerate(tracks):
        part, route, top_speed = start.future(track), int(traffic.route[i]), float(traffic.max_speed[i])
        truth = time_loss(traffic.intersection, route, track.position[part], track.speed[part], top_speed)
        # off the map no time is lost: the sum ends with the step in which the vehicle leaves it
        inside = slice(0, int(prediction.present[0, :, i].sum()) + 1)
        position, speed = (np.ascontiguousarray(one[0, inside, i]) for one in (prediction.position, prediction.speed))
        predicted = time_loss(traffic.intersection, route, position, speed, top_speed)
        at = np.arange(STEPS + 1)
        lost[:, i] = predicted[np.minimum(at, len(predicted) - 1)] - truth[np.minimum(at, len(truth) - 1)]
    return Errors(
        distance=prediction.position[0].astype(np.float64) - recorded.data,
        time_loss=lost,
        scored=known & np.array([track.road_user in SCORED for track in tracks], np.bool_),
        recorded=known[0],
        recording=np.full(len(traffic), start.scene.recording),
    )
