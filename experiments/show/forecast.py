"""Shows how well forecasts are calibrated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from experiments.show.style import set_style
from experiments.show.tables import in_percent, in_unit, markdown_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JOINT, PAIR = "order network", "order network, pair by itself"
BOOSTING, BOOSTING_PAIR = "gradient boosting", "gradient boosting, pair by itself"
SUMO_RULE, SUMO_CALIBRATED = "SUMO's rule", "SUMO's rule, calibrated"
DRAWN = "gap network, drivers drawn"
CHANCES = (JOINT, PAIR, BOOSTING, BOOSTING_PAIR, SUMO_CALIBRATED, DRAWN)
"""Models that give probabilities."""

Json = Mapping[str, Any]


def order_chances_table(found: Json) -> str:
    """Scores of one population's orders, by model."""
    heads = (
        *("", "right [%]", "minus SUMO's rule", "minus priority first", "right, not settled [%]", "log loss", "Brier"),
        "calibration error",
    )
    rows = []
    for name, row in found["models"].items():
        shares = (in_percent(row.get(key)) for key in ("accuracy", "accuracy_minus_sumo", "accuracy_minus_priority"))
        scores = (in_unit(row.get(key), form=".3f") for key in ("log_loss", "brier", "calibration_error"))
        rows.append((name, *shares, in_percent(row["open_accuracy"]), *scores))
    return markdown_table(heads, rows)


def order_places_table(orders: Json) -> str:
    """The order network at each place, by population."""
    heads = ("", "pairs, not settled", "right [%]", "minus SUMO's rule", "Brier", "calibration error")
    rows = []
    for population, found in orders.items():
        for place, row in found["places"].items():
            own = row["models"][JOINT]
            cells = (in_percent(own["accuracy"]), in_percent(own["accuracy_minus_sumo"]))
            scores = (in_unit(own[key], form=".3f") for key in ("brier", "calibration_error"))
            rows.append((f"{place}, {population}", f"{row['pairs']}, {row['open']}", *cells, *scores))
    return markdown_table(heads, rows)


def positions_table(positions: Json) -> str:
    """Scores of the quantiles of position."""
    heads = (
        *("", "samples", "in the 80 % interval [%]", "CRPS [m]", "absolute error: of the median [m]"),
        "of the prediction without orders [m]",
    )
    rows = []
    for key, row in positions.items():
        name = f"{key} s" if key[0].isdigit() else key.replace("_", " ")
        metres = (in_unit(row[one]) for one in ("crps", "median_error", "error_without_orders"))
        rows.append((name, str(row["count"]), in_percent(row["coverage"]), *metres))
    return markdown_table(heads, rows)


def forecast_text(results: Json) -> str:
    """All tables."""
    parts = []
    for population, found in results["orders"].items():
        parts.append(f"Pairs: {population}. {found['pairs']} pairs, {found['open']} of them not settled at the start.")
        parts.append(order_chances_table(found))
    return "\n\n".join([*parts, order_places_table(results["orders"]), positions_table(results["positions"])])


def plot_reliability(results: Json) -> Figure:
    """How often the yielder went first, over how probable that was: all pairs, and those recorded at the start."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 3.3), layout="constrained")
    for axes, (population, found) in zip(figure.subplots(1, 2), results["orders"].items(), strict=True):
        bins = found["reliability"]
        axes.plot([0, 1], [0, 1], color="#999", linewidth=0.8)
        sizes = [4.0 + 0.12 * row["count"] ** 0.5 * 10.0 for row in bins]
        axes.scatter([row["probability"] for row in bins], [row["frequency"] for row in bins], s=sizes, color="C0")
        axes.set_xlabel("probability that the yielder goes first")
        axes.set_ylabel("how often it did")
        axes.set_title(f"{'both recorded' if population == 'recorded' else 'all pairs'}, {found['open']}", fontsize=9)
        set_style(axes)
    return figure
