"""Shows what each part is worth: tables of the ablations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.tables import in_percent, in_unit, markdown_table

LEAD_MOMENTS = 500  # with an open conflict, in which whom to follow is changed


def ablation_tables(results: Mapping[str, Any]) -> str:
    """All of them."""
    return "\n\n".join((gap_table(results["gap"]), gail_table(results["gail"]), lead_table(results["lead"])))


def gap_table(rows: Mapping[str, Any]) -> str:
    """The gap networks."""
    heads = (
        *("gap network", "frames right, recorded [%]", "all [%]", "crossing order right [%]"),
        *("RMSE [m]", "MAD [m]"),
    )
    lines = []
    for name, row in rows.items():
        frames = (f"{100.0 * row['frames'][foes]:.1f}" for foes in ("recorded", "all"))
        lines.append((name, *frames, in_percent(row["order"]), *_distances(row)))
    return markdown_table(heads, lines)


def gail_table(rows: Mapping[str, Any]) -> str:
    """The drivers."""
    heads = (
        *("driver", "alone: RMSE [m]", "MAD [m]", "collided [%]", "line run [%]"),
        *("all predicted: RMSE [m]", "MAD [m]", "best, last checkpoint [m]"),
    )
    lines = []
    for name, row in rows.items():
        alone, seen = row["alone"], row["checkpoints"]
        cells = [f"{alone[key]:.1f}" for key in ("rmse", "mad")]
        cells += [f"{100.0 * alone[key]:.1f}" for key in ("collisions", "line_runs")]
        checkpoints = "" if seen is None else f"{seen['best']:.1f}, {seen['last']:.1f}"
        lines.append((name, *cells, *_distances(row), checkpoints))
    return markdown_table(heads, lines)


def lead_table(rows: Mapping[str, Any]) -> str:
    """Who leads."""
    heads = ("whom to follow", "crossing order right [%]", "RMSE [m]", "MAD [m]")
    return markdown_table(heads, [(name, in_percent(row["order"]), *_distances(row)) for name, row in rows.items()])


def _distances(row: Mapping[str, Any]) -> list[str]:
    return [in_unit(row[key], form=".1f") for key in ("distance_rmse", "distance_mad")]
