"""Shows what errors of perception do to orders, positions and the choice of a maneuver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from experiments.show.style import BLUE, QUIET, RED, set_style
from experiments.show.tables import in_percent, in_unit, markdown_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNAWARE, AWARE = "unaware", "aware"
"""Forecasts of what was seen, and forecasts that know by what it errs."""
ALONE = {"position": "position alone [m]", "speed": "speed alone [m/s]", "both": "both [m, m/s]"}
COLOURS = {"position": BLUE, "speed": RED, "both": QUIET}
PANELS = {
    "accuracy": "pairs in the recorded order [%]",
    "brier": "Brier score of the pairs",
    "rmse_seen": "RMSE until last seen [m]",
    "coverage_seen": "in the 80 % interval [%]",
    "same": "the same best maneuver [%]",
    "regret": "expected gain lost by the choice [s]",
}
"""Figures by their titles; those in percent are shares in the results."""

Json = Mapping[str, Any]


def perception_text(results: Json) -> str:
    """Both tables, with what they are of."""
    return (
        f"{results['moments']} moments of {results['recordings']} recordings, policy {results['policy']}; each errs"
        f" once.\n*Knows of it*: the forecast is the average over {results['draws']} traffics drawn around what was"
        f" seen.\n\n{forecasts_table(results)}\n\n{choices_table(results)}"
    )


def forecasts_table(results: Json) -> str:
    """Orders and positions: a row a size of the errors and forecast."""
    heads = (
        *("errors of position [m], speed [m/s]", "forecast", "pairs right [%]", "Brier", "RMSE at 10 s [m]"),
        *("MAD at 10 s [m]", "RMSE until last seen [m]", "MAD until last seen [m]", "in the 80 % interval [%]"),
    )
    rows = []
    for size, name, row in _forecasts(results["sizes"]):
        metres = (in_unit(row[key]) for key in ("rmse_10s", "mad_10s", "rmse_seen", "mad_seen"))
        scores = (in_percent(row["accuracy"]), in_unit(row["brier"], form=".3f"))
        rows.append((size, name, *scores, *metres, in_percent(row["coverage_seen"])))
    return markdown_table(heads, rows)


def choices_table(results: Json) -> str:
    """The best maneuver of what was seen, judged by the traffic as it is: a row a size of the errors and forecast."""
    heads = (
        *(
            "errors of position [m], speed [m/s]",
            "chosen by",
            "the same best maneuver [%]",
            "not to be carried out [%]",
        ),
        *("unsafe [%]", "expected gain lost [s]"),
    )
    rows = [
        (size, name, *(in_percent(row[key]) for key in ("same", "refused", "unsafe")), in_unit(row["regret"]))
        for size, name, row in _forecasts(results["sizes"])
    ]
    return markdown_table(heads, rows)


def _forecasts(sizes: Sequence[Json]) -> list[tuple[str, str, Json]]:
    said = {UNAWARE: "knows of nothing", AWARE: "knows of it"}
    return [
        (f"{one['position']:g}, {one['speed']:g}", said[name], one[name])
        for one in sizes
        for name in (UNAWARE, AWARE)
        if name in one
    ]


def plot_perception(results: Json) -> Figure:
    """Six figures over the size of the errors, of forecasts that know of them (dashed) and that do not."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 6.2), layout="constrained")
    for axes, (key, title) in zip(figure.subplots(3, 2, sharex=True).flat, PANELS.items(), strict=True):
        for which in ALONE:
            _draw(axes, results["sizes"], key, which)
        axes.set_title(title, fontsize=9, loc="left")
        axes.set_xscale("symlog", base=2, linthresh=0.25)
        axes.set_xticks(*2 * ([0.0, 0.25, 0.5, 1.0, 2.0],))
        axes.minorticks_off()
        set_style(axes)
    last = figure.axes[-2:]
    for axes in last:
        axes.set_xlabel("standard deviation of the errors")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure


def _draw(axes: Axes, sizes: Sequence[Json], key: str, which: str) -> None:
    share = 100.0 if "[%]" in PANELS[key] else 1.0
    of = [one for one in sizes if _is_of(one, which)]
    for name, style, said in ((UNAWARE, "-", "knows of nothing"), (AWARE, "--", "knows of it")):
        rows = [(max(one["position"], one["speed"]), one.get(name, one[UNAWARE])[key]) for one in of]
        rows = [(place, row) for place, row in rows if row is not None]
        places = [place for place, _ in rows]
        axes.plot(
            places,
            [share * row["value"] for _, row in rows],
            style,
            color=COLOURS[which],
            linewidth=1.4,
            marker="o",
            markersize=3.0,
            label=f"{ALONE[which]}, {said}",
        )
        if which == "both":
            low, high = ([share * row[end] for _, row in rows] for end in ("low", "high"))
            axes.fill_between(places, low, high, color=COLOURS[which], alpha=0.12, linewidth=0.0)


def _is_of(size: Json, which: str) -> bool:
    """Whether the errors are of one kind; none are of every kind."""
    position, speed = float(size["position"]), float(size["speed"])
    if position == speed == 0.0:
        return True
    return {"position": speed == 0.0, "speed": position == 0.0, "both": position == speed}[which]
