"""How far predictions are off over 10 s, in distance and in time loss: the paper's two plots, with more baselines.

python -m experiments.horizon                        on the development recordings
python -m experiments.horizon --split validation     for the report, once
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.results_files import write_result
from experiments.show.horizon import QUANTITIES, errors_text, plot_errors
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.errors import POPULATIONS, Errors, Forecaster, error_figures, errors
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import Moment
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES, load_places

Floats = NDArray[np.float64]

REFERENCES = ("idm", "idm_calibrated")
"""Models that the others are compared with, as a ratio of errors on the same samples."""
LAST = STEPS  # 10 s
FIGURES: dict[str, Callable[[Floats], float]] = {
    "rmse": lambda values: float(np.sqrt(np.mean(values**2))),
    "mad": lambda values: float(np.median(np.abs(values))),
    "q80": lambda values: float(np.quantile(np.abs(values), 0.8)),
}


@dataclass(frozen=True)
class Options:
    """Errors of distance and time loss over the horizon."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: tuple[str, ...] = ()
    """The maps (files) of scenes on maps that do not ship."""
    policies: tuple[str, ...] = ("gail", "ppo", "gap", "idm_calibrated", "constant_velocity")
    """Names of shipped policies or rules, or policy files."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw the errors over the horizon (.png, .svg, .pdf)."""


def horizon_results(found: dict[str, Errors]) -> dict[str, Any]:
    """What the errors of several models on the same moments come to.

    Returns:
        "time" [s]; under "models", by model and population, `rmse`, `mad` (median of the absolute error), `q80` (80 %
        quantile of it), `median_deviation` (from the median error, the other reading of MAD) and `mean` at each time,
        of "distance" [m] and "time_loss" [s], with the "count" of samples; None where there are none. Under "at_10s",
        by model, intervals over recordings for those recorded at the start, of the same figures and of the ratios to
        each of `REFERENCES`.
    """
    models = {name: {one: _curves(of_model, one) for one in POPULATIONS} for name, of_model in found.items()}
    at_10s = {name: _at_10s(found, name) for name in found}
    return {"time": [round(k * DT, 1) for k in range(STEPS + 1)], "models": models, "at_10s": at_10s}


def _curves(found: Errors, population: str) -> dict[str, Any]:
    chosen = [found.of(population, step) for step in range(STEPS + 1)]
    curves: dict[str, Any] = {"count": [int(one.sum()) for one in chosen]}
    for quantity in QUANTITIES:
        values = getattr(found, quantity)
        rows = [_figures(values[step, one]) if one.any() else None for step, one in enumerate(chosen)]
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
        "mean": float(values.mean()),
    }


def _at_10s(found: dict[str, Errors], name: str) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for quantity in QUANTITIES:
        result |= {f"{quantity}_{figure}": _interval(found, [name], quantity, figure) for figure in FIGURES}
        for other in REFERENCES:
            if other in found and other != name:
                result |= {
                    f"{quantity}_{figure}_to_{other}": _interval(found, [name, other], quantity, figure)
                    for figure in ("rmse", "mad")
                }
    return result


def _interval(found: dict[str, Errors], names: list[str], quantity: str, figure: str) -> dict[str, float]:
    """Of a model's figure, or of the ratio of two models' figures."""
    first = found[names[0]]
    chosen = first.of("recorded", LAST)
    rows = np.stack([getattr(found[name], quantity)[LAST, chosen] for name in names], axis=1)
    recording, of = first.recording[chosen], FIGURES[figure]

    def statistic(samples: Floats) -> float:
        ours, *reference = (of(model) for model in samples.T)
        return ours / reference[0] if reference else ours

    return interval({one: rows[recording == one] for one in sorted(set(recording.tolist()))}, statistic)


def measured(forecasters: Sequence[Forecaster], moments: Sequence[Moment]) -> dict[str, Any]:
    """The results of these models from these moments.

    Raises:
        ValueError: there is no moment to predict from.
    """
    found = {one.name: errors(one, moments) for one in tqdm(forecasters, desc="models", disable=None)}
    return {"moments": len(moments), **horizon_results(found)}


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    try:
        moments, refused = moments_in(load_places(options.scenes, options.map), options.split)
        results = measured([Predictor.load(policy) for policy in options.policies], moments)
        print(errors_text(results))
        if options.figure:
            write_figure(plot_errors(results, {name: name for name in results["models"]}), options.figure)
        write_result(
            options.out / f"horizon_{options.split}.json", {"split": options.split, "refused": len(refused), **results}
        )
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
