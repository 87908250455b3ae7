"""Shows how often crossing orders are predicted rightly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.tables import in_percent, markdown_table

PRIORITY_FIRST, SUMO_RULE, CRITICAL_GAP = "priority_first", "sumo_rule", "critical_gap"
BASELINES = (PRIORITY_FIRST, SUMO_RULE, CRITICAL_GAP)
COMPARED = (PRIORITY_FIRST, SUMO_RULE)  # with which every model is compared, pair by pair
POPULATIONS = ("recorded", "all")  # both vehicles recorded at the start, or also those extrapolated there


def order_table(results: Mapping[str, Any]) -> str:
    """The results in percent; intervals in brackets, pairs in parentheses: a table for each population."""
    parts = []
    for population in POPULATIONS:
        found = results[population]
        some = next(iter(found["models"].values()))
        firsts = [f"{first} first ({one['pairs']})" for first, one in some["by_first"].items()]
        times = [f"{one['after']:.0f}-{one['until']:.0f} s ({one['pairs']})" for one in some["by_time"]]
        minus = [f"minus {name}".replace("_", " ") for name in COMPARED]
        heads = ["", "accuracy", "not settled", "unresolved", *minus, *firsts, *times]
        rows = [(name.replace("_", " "), *_cells(model)) for name, model in found["models"].items()]
        parts.append(
            f"Population: {population}. {results['recordings']} recordings, {found['pairs']} pairs,"
            f" {found['settled']} of them settled at the start.\n\n{markdown_table(heads, rows)}"
        )
    return "\n\n".join(parts)


def _cells(model: Mapping[str, Any]) -> list[str]:
    unresolved = "" if model["unresolved"] is None else f"{100 * model['unresolved']:.1f}"
    parts = [one["accuracy"] for one in (*model["by_first"].values(), *model["by_time"])]
    return [
        *(in_percent(model["accuracy"]), in_percent(model["open_accuracy"]), unresolved),
        *(in_percent(model["minus"].get(other)) for other in COMPARED),
        *("" if one is None else f"{100.0 * one['value']:.1f}" for one in parts),
    ]
