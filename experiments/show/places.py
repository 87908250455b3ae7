"""Shows how far each model is off at a place, for whatever populations and figures there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.show.tables import markdown_table

KEYS = ("model", "population", "horizon")
HEADS = {
    "rmse": "RMSE [m]",
    "mad": "MAD [m]",
    "bias": "bias [m]",
    "time_loss_rmse": "time loss RMSE [s]",
    "time_loss_q80": "time loss 80 % [s]",
    "speed_behind": "behind the junction [m/s]",
    "recorded_speed_behind": "recorded there [m/s]",
    "count": "samples",
}
RULE = " --- "

Rows = Sequence[Mapping[str, Any]]


def place_table(rows: Rows) -> str:
    """The errors at the last horizon, a row a model, by population if there are several.

    Args:
        rows: those of `evaluate`, of several models.
    """
    last = max((row["horizon"] for row in rows), default=0.0)
    chosen = [row for row in rows if row["horizon"] == last]
    ordered = [row for one in populations(rows) for row in chosen if row["population"] == one]
    return _table(ordered, ("population", "model") if len(populations(rows)) > 1 else ("model",))


def population_table(rows: Rows, population: str) -> str:
    """The errors of one population over the horizon, a row a model, and how many samples there are."""
    chosen = {(row["model"], row["horizon"]): row for row in rows if row["population"] == population}
    horizons = sorted({horizon for _, horizon in chosen})
    models = list(dict.fromkeys(model for model, _ in chosen))
    cells = [
        [model, *(f"{one['rmse']:.1f} / {one['mad']:.1f}, {one['time_loss_rmse']:.1f}" for one in of_model)]
        for model in models
        for of_model in [[chosen[model, horizon] for horizon in horizons]]
    ]
    counts = [f"{chosen[models[0], horizon]['count']:.0f}" for horizon in horizons]
    heads = ["RMSE / MAD [m], time loss RMSE [s]", *(f"{horizon:g} s" for horizon in horizons)]
    return markdown_table(heads, [*cells, ["samples", *counts]], RULE)


def populations(rows: Rows) -> list[str]:
    """The populations, in the order in which they come."""
    return list(dict.fromkeys(row["population"] for row in rows))


def _table(rows: Rows, keys: Sequence[str]) -> str:
    figures = [name for name in (rows[0] if rows else ()) if name not in KEYS]
    heads = [*keys, *(HEADS.get(one, one) for one in figures)]
    cells = [[_cell(row[key]) for key in (*keys, *figures)] for row in rows]
    return markdown_table(heads, cells, RULE)


def _cell(value: Any) -> str:
    if value is None:  # nobody is there
        return ""
    if isinstance(value, float):
        return f"{value:.0f}" if value.is_integer() and value >= 1.0 else f"{value:.2f}"
    return str(value)
