"""A picture of predictions: position over time, without intervention beside the best order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.plots.colours import INK, PALE, route_colour
from intersection_env.prediction.measures import crossing_order, first_time
from intersection_env.prediction.predictor import Prediction
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Masked = np.ma.MaskedArray[Any, np.dtype[np.float32]]

SHOWN_BEFORE, SHOWN_BEYOND = 60.0, 22.0  # [m] of each approach, and beyond the first conflict, that are shown
NUMBER_WIDTH, NUMBER_ROW = 0.36, 4.6  # [s], [m], room that the number of a crossing vehicle takes


def plot_positions(
    default: Prediction,
    best: Prediction,
    recorded: Masked | None = None,
    titles: tuple[str, str] = ("no intervention", "best order"),
) -> Figure:
    """Position over time of each vehicle, without intervention beside the best order.

    Vehicles with an open conflict have the colour of the arm they come from, drawn bold if their crossing
    order differs between the two; numbers say in which order they enter their first conflict.

    Args:
        default, best: predictions of one traffic, of which scenario 0 is shown.
        recorded: (time, vehicle) positions as they were [m], masked where not recorded; dashed on the left.
        titles: of the two panels.
    """
    from matplotlib.figure import Figure

    traffic = default.traffic
    differs = (crossing_order(traffic, default) != crossing_order(traffic, best))[0]
    changed = set(traffic.conflicts[differs].ravel().tolist())
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, prediction, title in zip(panels, (default, best), titles, strict=True):
        _draw_positions(axes, prediction, changed)
        axes.set_title(title, fontsize=10, loc="left")
    start = past_conflict(traffic, default.position[0, :1])[0, _conflicting(traffic)]
    low = max(-SHOWN_BEFORE, float(start.min(initial=0.0)) - 4.0)
    panels[0].set(xlim=(-0.9, default.time[-1] + 0.3), ylim=(low, SHOWN_BEYOND))
    panels[0].set_ylabel("front bumper past its first conflict [m]")
    for axes, prediction in zip(panels, (default, best), strict=True):
        _draw_ids(axes, prediction, low)
    if recorded is not None:
        _draw_recorded(panels[0], traffic, default.time, recorded)
    _draw_key(figure, traffic, recorded is not None, bool(changed))
    return figure


def short_ids(traffic: Traffic) -> tuple[str, ...]:
    """The vehicles' ids without the recording, where all are of one: "07/15" becomes "15"."""
    recordings = {one.rpartition("/")[0] for one in traffic.ids}
    return tuple(one.rpartition("/")[2] for one in traffic.ids) if len(recordings) == 1 else traffic.ids


def _conflicting(traffic: Traffic) -> list[int]:
    """The indices of the vehicles with an open conflict."""
    return [int(i) for i in np.unique(traffic.conflicts)]


def past_conflict(traffic: Traffic, position: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far each front bumper is past the vehicle's first conflict [m]; position: (..., vehicle)."""
    return np.asarray(position + traffic.length / 2 - _first_conflicts(traffic), dtype=np.float32)


def _first_conflicts(traffic: Traffic) -> NDArray[np.float32]:
    """Where each vehicle's route has its first conflict, or its stop line if it has none: (vehicle,) [m]."""
    routes = [traffic.intersection.routes[index] for index in traffic.route]
    values = [one.first_conflict if one.first_conflict < one.length else one.stop_line for one in routes]
    return np.array(values, dtype=np.float32)


def _draw_positions(axes: Axes, prediction: Prediction, changed: set[int]) -> None:
    traffic = prediction.traffic
    past = np.ma.masked_array(past_conflict(traffic, prediction.position[0]), ~prediction.present[0])
    conflicting = _conflicting(traffic)
    axes.hlines(0.0, 0.0, float(prediction.time[-1]), color=INK, linewidth=0.8, zorder=1.0)  # ids stand before it
    for i in range(len(traffic)):
        colour = route_colour(traffic.intersection, int(traffic.route[i])) if i in conflicting else PALE
        width = 2.4 if i in changed else 1.2 if i in conflicting else 0.8
        axes.plot(prediction.time, past[:, i], color=colour, linewidth=width, zorder=2.0 + width)
    _draw_numbers(axes, traffic, past.data)
    axes.set_xlabel("time [s]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def _draw_numbers(axes: Axes, traffic: Traffic, past: NDArray[np.float32]) -> None:
    """Numbers the conflicting vehicles where they enter their first conflict; higher up where two would touch."""
    entered = first_time(past.T, 0.0)
    order = [i for i in np.argsort(entered, kind="stable").tolist() if np.isfinite(entered[i]) and past[0, i] < 0.0]
    free = [-np.inf] * 4  # by row, the time from which there is room
    for number, i in enumerate((i for i in order if i in _conflicting(traffic)), start=1):
        row = next((row for row, time in enumerate(free) if time <= entered[i]), 0)
        time = float(first_time(past[None, :, i], row * NUMBER_ROW)[0])
        if not np.isfinite(time):
            row, time = 0, float(entered[i])
        free[row] = time + NUMBER_WIDTH
        colour = route_colour(traffic.intersection, int(traffic.route[i]))
        box = {"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": colour, "linewidth": 1.2}
        place: dict[str, Any] = {"ha": "center", "va": "center", "zorder": 6.0}
        axes.text(time, row * NUMBER_ROW, str(number), fontsize=7, color=colour, bbox=box, **place)


def _draw_recorded(axes: Axes, traffic: Traffic, time: NDArray[np.float32], recorded: Masked) -> None:
    past = recorded + traffic.length / 2 - _first_conflicts(traffic)
    for i in _conflicting(traffic):
        colour = route_colour(traffic.intersection, int(traffic.route[i]))
        axes.plot(time, past[:, i], color=colour, linewidth=0.9, linestyle=(0, (3.0, 2.0)), alpha=0.75, zorder=2.5)


def _draw_ids(axes: Axes, prediction: Prediction, low: float) -> None:
    """Writes the ids of the conflicting vehicles where their lines begin, apart from each other."""
    traffic, ids = prediction.traffic, short_ids(prediction.traffic)
    past = past_conflict(traffic, prediction.position[0])
    conflicting = sorted(_conflicting(traffic), key=lambda i: float(past[0, i]))
    colour = {i: route_colour(traffic.intersection, int(traffic.route[i])) for i in conflicting}
    shown = [i for i in conflicting if low + 1.0 <= past[0, i] <= SHOWN_BEYOND]
    heights = apart(past[0, shown].astype(np.float64), (SHOWN_BEYOND - low) / 32.0)
    for i, height in zip(shown, heights.tolist(), strict=True):
        axes.plot([-0.25, 0.0], [height, past[0, i]], color=colour[i], linewidth=0.6)
        axes.text(-0.3, height, ids[i], color=colour[i], fontsize=7, ha="right", va="center")
    for i in conflicting:
        time = float(first_time(past[None, :, i], low)[0])
        if 0.0 < time < prediction.time[-1]:
            box: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
            place: dict[str, Any] = {"ha": "right", "va": "bottom", "zorder": 6.0}
            axes.text(time + 0.02, low + 0.8, ids[i], color=colour[i], fontsize=7, bbox=box, **place)


def apart(values: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """Ascending values moved as little as needed to be `gap` apart."""
    groups: list[tuple[float, int]] = []  # sum of (value - rank * gap), and how many; merged while they touch
    for value in values.tolist():
        total, count = value, 1
        while groups and groups[-1][0] / groups[-1][1] + groups[-1][1] * gap > total / count:
            before, count_before = groups.pop()
            total, count = before + (total - count * count_before * gap), count_before + count
        groups.append((total, count))
    return np.array([total / count + rank * gap for total, count in groups for rank in range(count)])


def _draw_key(figure: Figure, traffic: Traffic, with_recorded: bool, with_changed: bool) -> None:
    from matplotlib.lines import Line2D

    arms: dict[str, str] = {}
    for i in _conflicting(traffic):
        route = traffic.intersection.routes[traffic.route[i]]
        arms[route.entry] = route_colour(traffic.intersection, route.index)
    entries = [Line2D([], [], color=colour, linewidth=1.6, label=f"from {arm}") for arm, colour in sorted(arms.items())]
    if with_changed:
        entries.append(Line2D([], [], color=INK, linewidth=2.4, label="crosses in another order"))
    entries.append(Line2D([], [], color=PALE, linewidth=0.8, label="no open conflict"))
    if with_recorded:
        entries.append(Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (3.0, 2.0)), label="as recorded"))
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries), fontsize=8, frameon=False)
