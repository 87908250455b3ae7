"""Shows how gaps are decided: how often rightly, how probably over the time gap, and how reliable probabilities are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from experiments.show.style import BLUE, QUIET, RED, set_style
from experiments.show.tables import in_percent, markdown_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NETWORK = "network"
MEASURES = ("accuracy", "balanced_accuracy", "pair_accuracy", "accuracy_before_stop_line", "calibration_error")
BINS = 15  # of equal width, for the calibration error
LEAST_IN_BIN = 20  # samples for a point of the reliability curve that is drawn


@dataclass(frozen=True, eq=False)
class Curve:
    """How probable it is that a yielder goes before one foe, over the foe's distance to its stop line in time.

    merging: or crossing. speed: the yielder's [m/s]. to_stop_line, to_pga: its distances [m]. gaps: (gap,) [s].
    probability: (gap,). critical_gap: from which on going is the more probable [s]; None without such a gap.
    """

    merging: bool
    speed: float
    to_stop_line: float
    to_pga: float
    gaps: NDArray[np.float64]
    probability: NDArray[np.float64]
    critical_gap: float | None


def measures_table(by_foes: Mapping[str, Any]) -> str:
    """All measures of all deciders in percent, intervals in brackets: a table for each kind of foes."""
    heads = (None, "accuracy", "network minus it", "balanced", "per pair", "before the stop line", "calibration error")
    parts = []
    for foes, found in by_foes.items():
        rows = []
        for name, model in found["models"].items():
            figures = model["accuracy"], model["network_minus"].get("accuracy"), *(model[key] for key in MEASURES[1:])
            rows.append((name.replace("_", " "), *map(in_percent, figures)))
        parts.append(
            f"Foes: {foes}. {found['recordings']} recordings, {found['samples']} samples, {found['pairs']} pairs,"
            f" base rate {100 * found['base_rate']['value']:.1f} %.\n\n{markdown_table(heads, rows)}"
        )
    return "\n\n".join(parts)


def accuracy_table(results: Mapping[str, Any]) -> str:
    """How often gaps are decided rightly, and by how much the network leads, for both kinds of foes."""
    heads = [f"{name} {foes}" for foes in results["foes"] for name in ("accuracy,", "network minus it,")]
    rows = []
    for model in results["foes"]["recorded"]["models"]:
        found = [part["models"][model] for part in results["foes"].values()]
        figures = [figure for one in found for figure in (one["accuracy"], one["network_minus"].get("accuracy"))]
        rows.append((model, *map(in_percent, figures)))
    return markdown_table((None, *heads), rows)


def plot_acceptance(curves: Sequence[Curve], even: float, seen: float, by_foes: Mapping[str, Any]) -> Figure:
    """Acceptance over the time gap at several approach speeds, and how reliable probabilities are.

    Args:
        curves: crossing and merging, by speed.
        even: the probability from which on a gap is accepted.
        seen: the longest gap of a foe in the field of view [s].
        by_foes: the results, by the kind of foes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 5.0), layout="constrained")
    crossing, merging, reliability = figure.subplots(1, 3)
    _draw_curves(crossing, "Crossing", [one for one in curves if not one.merging], even, seen)
    _draw_curves(merging, "Merging", [one for one in curves if one.merging], even, seen)
    _draw_reliability(reliability, by_foes)
    for axes in (crossing, merging, reliability):
        axes.set_ylim(-0.02, 1.02)
        set_style(axes)
    return figure


def _draw_curves(axes: Axes, title: str, curves: Sequence[Curve], even: float, seen: float) -> None:
    from matplotlib import colormaps

    first, last = (float(curves[0].gaps[place]) for place in (0, -1))
    axes.axhline(even, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.axvspan(seen, last, color="#f3f3f0", zorder=0.0)
    axes.text(last - 0.1, 0.0, "foe beyond the field of view: extrapolated", fontsize=8, color=QUIET, ha="right")
    for one, shade in zip(curves, np.linspace(0.0, 0.85, len(curves)), strict=True):
        critical = "none" if one.critical_gap is None else f"{one.critical_gap:.1f} s"
        label = f"{one.speed:.0f} m/s, {one.to_stop_line:.0f} m, {one.to_pga:.0f} m:  {critical}"
        colour = colormaps["viridis"](shade)
        axes.plot(one.gaps, one.probability, color=colour, linewidth=1.8, label=label)
        if one.critical_gap is not None:
            axes.plot(one.critical_gap, even, "o", color=colour, markersize=6, markeredgecolor="white", zorder=3.0)
    _legend_below(axes, "yielder's speed, way to stop line, way to PGA:  critical gap (50 %)", 2)
    axes.set_title(title, fontsize=11)
    axes.set_xlabel("foe's distance to its stop line / 50 km/h [s]")
    axes.set_ylabel("probability that the gap is accepted")
    axes.set_xlim(first, last)


def _draw_reliability(axes: Axes, by_foes: Mapping[str, Any]) -> None:
    axes.plot([0, 1], [0, 1], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    for (foes, found), colour in zip(by_foes.items(), (BLUE, RED), strict=True):
        model = found["models"][NETWORK]
        rows = [row for row in model["reliability"] if row["samples"] >= LEAST_IN_BIN]
        x, y, n = np.array([[row[key] for key in ("predicted", "observed", "samples")] for row in rows]).T
        label = f"{foes} foes:  expected calibration error {model['calibration_error']['value']:.3f}"
        axes.plot(x, y, color=colour, linewidth=1.4, label=label)
        axes.scatter(x, y, s=6.0 + 1.2 * np.sqrt(n), color=colour)
    _legend_below(axes, f"the network in {BINS} bins, those with at least {LEAST_IN_BIN} samples", 1)
    axes.set_title("Reliability of the decisions", fontsize=11)
    axes.set_xlabel("predicted probability")
    axes.set_ylabel("share that went first")


def _legend_below(axes: Axes, title: str, columns: int) -> None:
    looks: dict[str, Any] = {"fontsize": 8, "title_fontsize": 8, "frameon": False}
    axes.legend(title=title, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=columns, **looks)
