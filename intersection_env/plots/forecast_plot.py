"""A picture of a forecast: where vehicles may be over time, and how probable each crossing order is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from intersection_env.plots.colours import INK, PALE, route_colour
from intersection_env.plots.prediction_plot import SHOWN_BEFORE, SHOWN_BEYOND, apart, past_conflict, short_ids
from intersection_env.prediction.forecast import Forecast

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVELS = (0.1, 0.5, 0.9)
ORDERS = 8  # shown at most
LONGEST = 46  # characters of an order's words


def plot_forecast(found: Forecast) -> Figure:
    """Fans of position over time of the vehicles with an open conflict, beside the most probable orders.

    A fan holds 80 % of the probability, its line the median. Colours are those of the arms.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    fans, bars = figure.subplots(1, 2, width_ratios=(6, 5))
    _draw_fans(fans, found)
    _draw_orders(bars, found)
    return figure


def _draw_fans(axes: Axes, found: Forecast) -> None:
    traffic, ids = found.traffic, short_ids(found.traffic)
    low, median, high = past_conflict(traffic, found.position_quantiles(LEVELS))
    time = found.prediction.time
    conflicting = np.unique(traffic.conflicts).tolist()
    axes.axhline(0.0, color=INK, linewidth=0.8, zorder=1.0)
    for i in range(len(traffic)):
        colour = route_colour(traffic.intersection, int(traffic.route[i])) if i in conflicting else PALE
        if i in conflicting:
            axes.fill_between(time, low[:, i], high[:, i], color=colour, alpha=0.18, linewidth=0.0)
        axes.plot(time, median[:, i], color=colour, linewidth=1.3 if i in conflicting else 0.8)
    shown = [i for i in conflicting if -SHOWN_BEFORE <= median[0, i] <= SHOWN_BEYOND]
    shown.sort(key=lambda i: float(median[0, i]))
    heights = apart(median[0, shown].astype(np.float64), (SHOWN_BEFORE + SHOWN_BEYOND) / 32.0)
    for i, height in zip(shown, heights.tolist(), strict=True):
        colour = route_colour(traffic.intersection, int(traffic.route[i]))
        axes.text(-0.1, height, ids[i], color=colour, fontsize=7, ha="right", va="center")
    axes.set(xlim=(-0.9, float(time[-1])), ylim=(-SHOWN_BEFORE, SHOWN_BEYOND), xlabel="time [s]")
    axes.set_ylabel("front bumper past its first conflict [m]")
    axes.set_title("80 % of where each may be, and the median", fontsize=10, loc="left")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def _draw_orders(axes: Axes, found: Forecast) -> None:
    traffic = found.traffic
    short = dict(zip(traffic.ids, short_ids(traffic), strict=True))
    count = min(ORDERS, len(found.orders))
    rows = np.arange(count)
    axes.barh(rows, 100.0 * found.probability[:count], color="#7a8fb0", height=0.62)
    for row, words in enumerate(found.words()[:count]):
        text = ", ".join(short.get(one, one) for one in words.split(", "))
        text = text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"
        axes.text(0.6, row, f"{100.0 * found.probability[row]:.0f} %  {text}", fontsize=8, va="center")
    left = 1.0 - float(found.probability[:count].sum())
    axes.set_title(f"crossing orders; {100.0 * max(left, 0.0):.0f} % on further ones", fontsize=10, loc="left")
    axes.set(xlabel="probability [%]", yticks=[], xlim=(0.0, None))
    axes.invert_yaxis()
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(labelsize=8)
