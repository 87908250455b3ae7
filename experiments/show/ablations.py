"""Shows what each part is worth: tables of the ablations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.horizon import UNTIL_LAST_SEEN, speeds_behind
from experiments.show.tables import in_percent, in_unit, markdown_table

LEAD_MOMENTS = 500  # with an open conflict, in which whom to follow is changed
DISTANCES = (
    *("10 s: RMSE [m]", "MAD [m]"),
    *("until last seen: RMSE [m]", "MAD [m]", "bias [m]", "behind the junction, recorded [m/s]"),
)


def ablation_tables(results: Mapping[str, Any]) -> str:
    """All of them."""
    return "\n\n".join((gap_table(results["gap"]), gail_table(results["gail"]), lead_table(results["lead"])))


def gap_table(rows: Mapping[str, Any]) -> str:
    """The gap networks."""
    heads = (
        *("gap network", "frames right, recorded [%]", "all [%]", "crossing order right [%]"),
        *DISTANCES,
    )
    lines = []
    for name, row in rows.items():
        frames = [""] * 2
        if row["frames"] is not None:
            frames = [f"{100.0 * row['frames'][foes]:.1f}" for foes in ("recorded", "all")]
        lines.append((name, *frames, in_percent(row["order"]), *_distances(row)))
    return markdown_table(heads, lines)


def gail_table(rows: Mapping[str, Any]) -> str:
    """The drivers."""
    heads = (
        *("driver", "alone: RMSE [m]", "MAD [m]", "collided [%]", "line run [%]"),
        *(f"all predicted: {DISTANCES[0]}", *DISTANCES[1:], "best, last checkpoint [m]"),
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
    heads = ("whom to follow", "crossing order right [%]", *DISTANCES)
    return markdown_table(heads, [(name, in_percent(row["order"]), *_distances(row)) for name, row in rows.items()])


def _distances(row: Mapping[str, Any]) -> list[str]:
    at_10s = [in_unit(row["at_10s"][key], form=".1f") for key in ("distance_rmse", "distance_mad")]
    last = [in_unit(row["until_last_seen"][key], form=".1f") for key in UNTIL_LAST_SEEN]
    return [*at_10s, *last, speeds_behind(row)]
