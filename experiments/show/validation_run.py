"""Shows how driving networks do in the closed loop, and how hard they accelerate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.show.style import set_style
from experiments.show.tables import in_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def runs_text(results: Mapping[str, Any]) -> str:
    """The figures of the longer runs, as text."""
    lines = [f"{'driver':<8} {'gaps by':<14} {'reward':>7} {'between':>8} {'collisions /s':>28} {'speed':>6}"]
    for name, rows in results["drivers"].items():
        for gap, once in rows.items():
            run = once["longer"]
            collisions = in_unit(run["collisions"], form=".1e")
            figures = (
                f"{run['reward']:>7.2f} {run['reward_between_collisions']:>8.2f} {collisions:>28} {run['speed']:>6.1f}"
            )
            lines.append(f"{name:<8} {gap:<14} {figures}")
    return "\n".join(lines)


def plot_accelerations(results: Mapping[str, Any], names: Mapping[str, str]) -> Figure:
    """The shares of accelerations, these drivers beside the recorded ones.

    Args:
        results: as `closed_loop_results` gives them.
        names: drivers to draw, in this order, and what to call them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.5, 2.6), layout="constrained")
    axes = figure.subplots()
    middles = 0.5 * (np.array(results["edges"][1:]) + np.array(results["edges"][:-1]))
    width = results["edges"][1] - results["edges"][0]
    for k, (driver, name) in enumerate({"recorded": "recorded", **names}.items()):
        spread = results["acceleration"][driver]
        style: dict[str, Any] = {"color": "#555", "linewidth": 2.0} if driver == "recorded" else {"color": f"C{k - 1}"}
        axes.plot(middles, np.maximum(spread["histogram"], 1e-6) / width, label=name, **style)
    axes.set_yscale("log")
    axes.set_ylim(bottom=1e-4)
    axes.set_xlabel("acceleration [m/s²]")
    axes.set_ylabel("density [s²/m]")
    set_style(axes)
    axes.legend(frameon=False, fontsize=8)
    return figure
