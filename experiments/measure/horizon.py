"""How far predictions are off over 10 s and until vehicles are last seen, in distance and in time loss.

The paper's two plots, with more baselines, and what its choice of vehicles leaves out.

python -m experiments.horizon                        on the development recordings
python -m experiments.horizon --split validation     for the report, once
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from agents.training.options import Maps
from experiments.measure.forecasters import MeanOverOrders, MostProbableOrder
from experiments.measure.order_handed_in import OrderHandedIn
from experiments.measure.recorded import places_of
from experiments.models.patient import patient
from experiments.results_files import check_outputs, write_result
from experiments.show.horizon import QUANTITIES, errors_text, order_handed_in_text, plot_errors
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.errors import (
    AT_HORIZON,
    LAST_SEEN,
    UNTIL_LAST_SEEN,
    Errors,
    Floats,
    Forecaster,
    MaskedFloats,
    error_figures,
    errors,
    mean_speed,
)
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import HORIZONS, Moment
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES

Names = NDArray[np.str_]

REFERENCES = ("idm", "idm_calibrated", "constant_velocity")
"""Models that the others are compared with, as a ratio of errors on the same samples."""
AT = {"at_4s": round(4.0 / DT), "at_10s": STEPS}
"""By what results call it, the step at which errors have intervals."""
FIGURES: dict[str, Callable[[Floats], float]] = {
    "rmse": lambda values: float(np.sqrt(np.mean(values**2))),
    "mad": lambda values: float(np.median(np.abs(values))),
    "q80": lambda values: float(np.quantile(np.abs(values), 0.8)),
    "bias": lambda values: float(np.mean(values)),
}
RATIOS = ("rmse", "mad")


@dataclass(frozen=True)
class Options:
    """Errors of distance and time loss over the horizon."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policies: tuple[str, ...] = ("rollout_gradient", "gail", "ppo", "gap", "idm_calibrated", "constant_velocity")
    """Names of shipped policies or rules, or policy files."""
    order_handed_in: tuple[str, ...] = ("rollout_gradient", "gail", "idm_calibrated")
    """Likewise, those that predict once more, with the recorded crossing order handed in."""
    forecasting: tuple[str, ...] = ("rollout_gradient",)
    """Likewise, those whose most probable order, and whose mean over the orders, is scored too."""
    patient: tuple[str, ...] = ("rollout_gradient",)
    """Likewise, those that predict once more, with patience kept."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw the errors over the horizon (.png, .svg, .pdf)."""


def horizon_results(found: Mapping[str, Errors], references: Sequence[str] = REFERENCES) -> dict[str, Any]:
    """What the errors of several models on the same moments come to, of "distance" [m] and "time_loss" [s].

    Args:
        found: by model.
        references: models that the others are compared with.

    Returns:
        "time" [s]. Under "models", by model: for each of `AT_HORIZON`, the figures `rmse`, `mad` (median of the
        absolute error), `q80` (80 % quantile of it), `median_deviation` (from the median error, the other reading of
        MAD) and `bias` (mean error) at each time, with the "count" of samples; the same "until_last_seen", one each,
        and for those "last_seen" within the 2 s up to each of its "horizon" [s]; None where there are no samples; and
        their "speed_behind" the junction, "predicted" and "recorded" [m/s]. Under each of `AT` for those
        recorded at the start and then, and under "until_last_seen", by model: intervals over recordings of the figures
        in `FIGURES`, and of the ratios to each of the references.
    """
    return {
        "time": [round(k * DT, 1) for k in range(STEPS + 1)],
        "models": {name: _of_model(of_model) for name, of_model in found.items()},
        **{one: _every_interval(found, references, partial(_at, step)) for one, step in AT.items()},
        UNTIL_LAST_SEEN: _every_interval(found, references, Errors.until_last_seen),
    }


def _of_model(found: Errors) -> dict[str, Any]:
    of = {one: [found.of(one, step) for step in range(STEPS + 1)] for one in AT_HORIZON}
    result: dict[str, Any] = {
        one: _curves({key: [getattr(found, key)[k, at] for k, at in enumerate(chosen)] for key in QUANTITIES})
        for one, chosen in of.items()
    }
    last = {key: found.until_last_seen(key) for key in QUANTITIES}
    everybody = _curves({key: [values.compressed()] for key, values in last.items()})
    result[UNTIL_LAST_SEEN] = {
        "count": everybody["count"][0],
        **{key: {name: values[0] for name, values in everybody[key].items()} for key in QUANTITIES},
    }
    groups = [found.seen_up_to(horizon) for horizon in HORIZONS]
    by_time = {key: [values[group].compressed() for group in groups] for key, values in last.items()}
    result[LAST_SEEN] = {"horizon": list(HORIZONS), **_curves(by_time)}
    result["speed_behind"] = _speeds_behind(found)
    return result


def _speeds_behind(found: Errors) -> dict[str, float | None]:
    speeds = {"predicted": found.behind, "recorded": found.recorded_behind}
    scored = ~np.ma.getmaskarray(found.last_seen())
    return {key: mean_speed(one[:, scored]) for key, one in speeds.items()}


def _curves(samples: dict[str, list[Floats]]) -> dict[str, Any]:
    """Figures of each of a list of samples, by quantity; None where there are none."""
    curves: dict[str, Any] = {"count": [len(values) for values in samples[QUANTITIES[0]]]}
    for quantity, groups in samples.items():
        rows = [_figures(values) if len(values) else None for values in groups]
        names = next(row for row in reversed(rows) if row is not None) if any(rows) else {}
        curves[quantity] = {name: [None if row is None else row[name] for row in rows] for name in names}
    return curves


def _figures(values: Floats) -> dict[str, float]:
    found = error_figures(values)
    return {
        "rmse": found.rmse,
        "mad": found.mad,
        "q80": found.quantile_80,
        "median_deviation": float(np.median(np.abs(values - np.median(values)))),
        "bias": found.bias,
    }


def _at(step: int, found: Errors, quantity: str) -> MaskedFloats:
    """(sample,), masked where it is not recorded at the start and then."""
    values: Floats = getattr(found, quantity)
    return np.ma.masked_array(values[step], ~found.of("recorded", step))


def _every_interval(
    found: Mapping[str, Errors], references: Sequence[str], samples: Callable[[Errors, str], MaskedFloats]
) -> dict[str, Any]:
    """By model."""
    present = [one for one in references if one in found]
    return {name: _intervals(found, name, [one for one in present if one != name], samples) for name in found}


def _intervals(
    found: Mapping[str, Errors], name: str, others: Sequence[str], samples: Callable[[Errors, str], MaskedFloats]
) -> dict[str, dict[str, float] | None]:
    """Of a model's figures, and of their ratios to other models' figures; None where the other has no error."""
    result: dict[str, dict[str, float] | None] = {}
    for quantity in QUANTITIES:
        of = {one: samples(found[one], quantity) for one in (name, *others)}
        chosen = ~np.ma.getmaskarray(of[name])
        recording = found[name].recording[chosen]
        rows = {one: values.data[chosen] for one, values in of.items()}
        for figure in FIGURES:
            result[f"{quantity}_{figure}"] = _interval(recording, [rows[name]], figure)
        for other in others:
            for figure in RATIOS:
                pair = [rows[name], rows[other]]
                result[f"{quantity}_{figure}_to_{other}"] = _interval(recording, pair, figure)
    return result


def _interval(recording: Names, errors: list[Floats], figure: str) -> dict[str, float] | None:
    """Of the figure of one model's errors (sample,), or of the ratio of two models' figures; None without samples."""
    if not len(recording):
        return None
    rows, of = np.stack(errors, axis=1), FIGURES[figure]

    def statistic(samples: Floats) -> float:
        ours, *reference = (of(model) for model in samples.T)
        return ours / reference[0] if reference else ours

    try:
        return interval({one: rows[recording == one] for one in sorted(set(recording.tolist()))}, statistic)
    except ZeroDivisionError:  # all drive at constant velocity, say
        return None


def measured(
    forecasters: Sequence[Forecaster], moments: Sequence[Moment], informed: Sequence[Predictor] = ()
) -> dict[str, Any]:
    """The results of these models from these moments.

    Args:
        forecasters: predict without intervention.
        moments: to predict from.
        informed: predict with the recorded order handed in; their results are under "order_handed_in".

    Raises:
        ValueError: there is no moment to predict from.
    """
    found = {one.name: errors(one, moments) for one in tqdm(forecasters, desc="models", disable=None)}
    return {"moments": len(moments), **horizon_results(found), "order_handed_in": _handed_in(informed, moments)}


def _handed_in(predictors: Sequence[Predictor], moments: Sequence[Moment]) -> dict[str, Any]:
    """With the recorded order handed in: as of `horizon_results`, until last seen; "refused", by model, moments."""
    informed = OrderHandedIn.to(predictors, moments)
    found = {one.name: errors(one, moments) for one in informed}
    return {
        UNTIL_LAST_SEEN: _every_interval(found, REFERENCES, Errors.until_last_seen),
        "models": {name: {"speed_behind": _speeds_behind(of_model)} for name, of_model in found.items()},
        "refused": {one.name: one.refused for one in informed},
    }


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    out = options.out / f"horizon_{options.split}.json"
    try:
        check_outputs(out, options.figure)
        moments, refused = moments_in(places_of(options.scenes, options.map, options.split), options.split)
        models, informed = ([Predictor.load(one) for one in of] for of in (options.policies, options.order_handed_in))
        forecasts = [
            form(Predictor.load(one)) for one in options.forecasting for form in (MostProbableOrder, MeanOverOrders)
        ]
        patients = [patient(Predictor.load(one)) for one in options.patient]
        results = measured([*models, *patients, *forecasts], moments, informed)
        print(errors_text(results))
        print(order_handed_in_text(results))
        if options.figure:
            write_figure(plot_errors(results, {name: name for name in results["models"]}), options.figure)
        write_result(out, {"split": options.split, "refused": len(refused), **results})
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
