"""How far predictions are off over 10 s, in distance and in time loss: the paper's two plots, with more baselines.

python -m experiments.horizon                        on the development recordings
python -m experiments.horizon --split validation     for the report, once
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.results_files import write_result
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.errors import POPULATIONS, Errors, Forecaster, error_figures, errors
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import Moment, moments_of
from intersection_env.plots.files import write_figure
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

QUANTITIES = ("distance", "time_loss")
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

    scenes: Path = Path("out/scenes.npz")
    """The scenes file; `python -m data.build` makes it."""
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
        value = of(samples[:, 0])
        return value if len(names) == 1 else value / of(samples[:, 1])

    return interval({one: rows[recording == one] for one in sorted(set(recording.tolist()))}, statistic)


def measured(forecasters: Sequence[Forecaster], moments: Sequence[Moment]) -> dict[str, Any]:
    """The results of these models from these moments.

    Raises:
        ValueError: there is no moment to predict from.
    """
    found = {one.name: errors(one, moments) for one in tqdm(forecasters, desc="models", disable=None)}
    return {"moments": len(moments), **horizon_results(found)}


def plot(results: dict[str, Any], names: dict[str, str]) -> Figure:
    """Distance and time-loss error over the horizon, vehicles recorded at the start.

    Args:
        results: as `horizon_results` gives them.
        names: models to draw, in this order, and what to call them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 2.9), layout="constrained")
    for axes, quantity, label in zip(
        figure.subplots(1, 2), QUANTITIES, ("distance error [m]", "time loss error [s]"), strict=True
    ):
        for k, (model, name) in enumerate(names.items()):
            curves = results["models"][model]["recorded"][quantity]
            color = f"C{k}"
            axes.plot(results["time"], curves["rmse"], color=color, label=name, linewidth=1.4)
            axes.plot(results["time"], curves["mad"], color=color, linestyle="--", linewidth=1.0)
        axes.set_xlabel("horizon [s]")
        axes.set_ylabel(label)
        axes.set_xlim(0.0, 10.0)
        axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e4e4e1", linewidth=0.6)
    axes.plot([], [], color="#555", linewidth=1.4, label="RMSE")
    axes.plot([], [], color="#555", linestyle="--", linewidth=1.0, label="MAD")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    return figure


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    try:
        moments, refused = moments_of(Scenes.load(options.scenes).select(options.split))
        results = measured([Predictor.load(policy) for policy in options.policies], moments)
        print(table(results))
        if options.figure:
            write_figure(plot(results, {name: name for name in results["models"]}), options.figure)
        write_result(
            options.out / f"horizon_{options.split}.json", {"split": options.split, "refused": len(refused), **results}
        )
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def table(results: dict[str, Any]) -> str:
    """Each model's errors after 10 s with their intervals, as text."""
    lines = [f"{'10 s, recorded':<20} {'RMSE [m]':>20} {'MAD [m]':>20} {'time loss RMSE [s]':>20} {'80 % [s]':>20}"]
    for name, row in results["at_10s"].items():
        keys = ("distance_rmse", "distance_mad", "time_loss_rmse", "time_loss_q80")
        cells = [f"{row[key]['value']:.2f} [{row[key]['low']:.2f}, {row[key]['high']:.2f}]" for key in keys]
        lines.append(f"{name:<20} " + " ".join(f"{cell:>20}" for cell in cells))
    return "\n".join(lines)
