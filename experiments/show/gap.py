"""Draws how the gap network accepts: over the time gap at several approach speeds, and its reliability."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from agents.gap.baselines import EVEN, Floats
from agents.gap.samples import GapSamples, Kinematics
from agents.networks.gap import GapNetwork
from experiments.measure.gap_scores import BINS, FOES, NETWORK
from intersection_env.features import Gap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPEEDS = (0.0, 2.0, 4.0, 6.0, 8.0)  # [m/s] of the yielder, in the figure
SPEED_BAND = 1.0  # [m/s] to either side, whose median distances stand for a speed
FOE_SPEED = 50.0 / 3.6  # [m/s], in the figure
GAPS = np.linspace(0.0, 8.0, 161)  # [s], in the figure
QUIET = "#8a8a86"
LEAST_IN_BIN = 20  # samples for a point of the reliability curve that is drawn


def plot(network: GapNetwork, samples: GapSamples, results: Mapping[str, Any]) -> Figure:
    """Acceptance over the time gap at several approach speeds, and how reliable probabilities are.

    Args:
        samples: where the distances at each speed are taken from.
        results: as `on_split` gives them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 5.0), layout="constrained")
    crossing, merging, reliability = figure.subplots(1, 3)
    _draw_acceptance(crossing, network, samples, False)
    _draw_acceptance(merging, network, samples, True)
    _draw_reliability(reliability, results)
    for axes in (crossing, merging, reliability):
        axes.set_ylim(-0.02, 1.02)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e4e4e1", linewidth=0.6)
    return figure


def typical_distances(samples: GapSamples, speed: float, merging: bool) -> tuple[float, float]:
    """The median distances to stop line and PGA [m] of yielders before the line at about this speed."""
    to_stop = samples.kinematics[:, Kinematics.DISTANCE_TO_STOP_LINE]
    merges = samples.kinematics[:, Kinematics.MERGING] == 1.0
    near = np.abs(samples.features[:, Gap.SPEED] - speed) <= SPEED_BAND
    chosen = near & (merges == merging) & (to_stop >= 0.0)
    if not chosen.any():
        raise ValueError(f"no yielder at about {speed} m/s before its stop line to take distances from")
    return float(np.median(to_stop[chosen])), float(np.median(samples.features[chosen, Gap.DISTANCE_TO_PGA]))


def acceptance(network: GapNetwork, speed: float, to_pga: float) -> Floats:
    """(gap,) how probable it is that one foe at 50 km/h, `GAPS` away from its stop line, is not waited for."""
    rows = np.stack(np.broadcast_arrays(to_pga, speed, GAPS * FOE_SPEED, FOE_SPEED), axis=1).astype(np.float32)
    with torch.no_grad():
        chance: Floats = torch.sigmoid(network(torch.from_numpy(rows)).double()).numpy()
    return chance


def critical(chance: Floats) -> float | None:
    """The least gap [s] from which on acceptance is the more probable; None if there is none."""
    refused = np.flatnonzero(chance <= EVEN)
    if len(refused) in (0, len(chance)) or refused[-1] == len(chance) - 1:
        return None
    k = int(refused[-1])
    return float(np.interp(EVEN, chance[k : k + 2], GAPS[k : k + 2]))


def _draw_acceptance(axes: Axes, network: GapNetwork, samples: GapSamples, merging: bool) -> None:
    from matplotlib import colormaps

    axes.axhline(EVEN, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    seen = float(samples.features[samples.recorded, Gap.FOE_DISTANCE_TO_STOP_LINE].max()) / FOE_SPEED
    axes.axvspan(seen, GAPS[-1], color="#f3f3f0", zorder=0.0)
    axes.text(GAPS[-1] - 0.1, 0.0, "foe beyond the field of view: extrapolated", fontsize=8, color=QUIET, ha="right")
    for speed, shade in zip(SPEEDS, np.linspace(0.0, 0.85, len(SPEEDS)), strict=True):
        to_stop, to_pga = typical_distances(samples, speed, merging)
        chance = acceptance(network, speed, to_pga)
        even = critical(chance)
        label = f"{speed:.0f} m/s, {to_stop:.0f} m, {to_pga:.0f} m:  " + ("none" if even is None else f"{even:.1f} s")
        (line,) = axes.plot(GAPS, chance, color=colormaps["viridis"](shade), linewidth=1.8, label=label)
        if even is not None:
            axes.plot(even, EVEN, "o", color=line.get_color(), markersize=6, markeredgecolor="white", zorder=3.0)
    _legend_below(axes, "yielder's speed, way to stop line, way to PGA:  critical gap (50 %)", 2)
    axes.set_title("Merging" if merging else "Crossing", fontsize=11)
    axes.set_xlabel("foe's distance to its stop line / 50 km/h [s]")
    axes.set_ylabel("probability that the gap is accepted")
    axes.set_xlim(GAPS[0], GAPS[-1])


def _draw_reliability(axes: Axes, results: Mapping[str, Any]) -> None:
    axes.plot([0, 1], [0, 1], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    for foes, colour in zip(FOES, ("#2f6da8", "#b5483a"), strict=True):
        model = results[foes]["models"][NETWORK]
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
    below = (0.5, -0.15)
    axes.legend(
        title=title,
        loc="upper center",
        bbox_to_anchor=below,
        ncols=columns,
        fontsize=8,
        title_fontsize=8,
        frameon=False,
    )
