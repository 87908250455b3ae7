"""Shows how many crossing orders are feasible, and how much time the best of them saves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.show.style import BLUE, QUIET, RED, set_style
from experiments.show.tables import in_percent, in_unit, markdown_table
from intersection_env.prediction.maneuvers import WORTHWHILE_GAIN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def gain_table(results: Mapping[str, Any]) -> str:
    """The gains by the share of cooperative vehicles; intervals in brackets."""
    orders = results["orders"]
    heads = (
        *("cooperative", "mean gain [s]", "moments with a worthwhile order [%]"),
        *("mean gain there [s]", "loss saved [%]"),
    )
    rows = [
        (
            f"{100 * one['share']:.0f} %",
            *(in_unit(one["mean_gain"]), in_percent(one["worthwhile"])),
            *(in_unit(one["mean_gain_worthwhile"]), in_percent(one["saved"])),
        )
        for one in results["shares"]
    ]
    return (
        f"{results['moments']} moments of {results['recordings']} recordings, policy {results['policy']}: feasible"
        f" orders {orders['median']:.0f} (median), {orders['p90']:.0f} (90 %), {orders['max']} (most).\n\n"
        f"{markdown_table(heads, rows)}"
    )


def plot_gain(results: Mapping[str, Any]) -> Figure:
    """The mean gain over the share of cooperative vehicles, and how many orders are feasible.

    Args:
        results: as `maneuver_results` gives them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 3.1), layout="constrained")
    gain, orders = figure.subplots(1, 2)
    _draw_gain(gain, results)
    _draw_orders(orders, results["orders"])
    for axes in (gain, orders):
        set_style(axes)
        axes.set_axisbelow(True)
    return figure


def _draw_gain(axes: Axes, results: Mapping[str, Any]) -> None:
    percent = [100.0 * one["share"] for one in results["shares"]]
    value, low, high = ([one["mean_gain"][key] for one in results["shares"]] for key in ("value", "low", "high"))
    label = f"95 % interval over {results['recordings']} recordings"
    axes.fill_between(percent, low, high, color=BLUE, alpha=0.18, linewidth=0.0, label=label)
    axes.plot(percent, value, "o-", color=BLUE, linewidth=1.8, markersize=4.5, label="mean of all moments")
    axes.legend(loc="upper left", fontsize=8, frameon=False)
    axes.set(xlim=(0.0, 102.0), xlabel="vehicles that cooperate [%]", ylabel="time loss saved by the best order [s]")
    axes.set_ylim(0.0, 1.08 * max(*high, WORTHWHILE_GAIN / 10.0))
    axes.set_title(f"Gain in {results['moments']} moments, predicted by {results['policy']}", fontsize=9, loc="left")


def _draw_orders(axes: Axes, orders: Mapping[str, Any]) -> None:
    counts = np.sort(orders["counts"])
    at_least = 100.0 * (1.0 - np.arange(len(counts)) / len(counts))
    axes.step(counts, at_least, where="pre", color=RED, linewidth=1.8)
    for name, text, height in (("median", "median", 50.0), ("p90", "90 % quantile", 10.0)):
        axes.plot(orders[name], height, "o", color=RED, markersize=5.5, markeredgecolor="white", zorder=3.0)
        axes.text(orders[name] * 1.25, height + 1.5, f"{text} {orders[name]:,.0f}", fontsize=8)
    if counts[-1] == orders["counted_to"]:
        axes.axvline(orders["counted_to"], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.text(orders["counted_to"], 100.0, "not counted further ", fontsize=8, color=QUIET, ha="right", va="top")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.set(ylim=(0.0, 103.0), xlabel="feasible orders, all vehicles cooperating")
    axes.set_ylabel("moments with so many or more [%]")
    axes.set_title("Choice of orders", fontsize=9, loc="left")
