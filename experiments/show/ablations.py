"""Shows what each part is worth: tables of the ablations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.horizon import UNTIL_LAST_SEEN, speeds_behind
from experiments.show.tables import in_percent, in_unit, markdown_table

MOST_LEFT_OUT = 1.25  # ours: RMSE at a place left out, to that of who learned from it; at most
LEAD_MOMENTS = 500  # with an open conflict, in which whom to follow is changed
DISTANCES = (
    *("10 s: RMSE [m]", "MAD [m]"),
    *("until last seen: RMSE [m]", "MAD [m]", "bias [m]", "behind the junction, recorded [m/s]"),
)


def ablation_tables(results: Mapping[str, Any]) -> str:
    """All of those that there are."""
    of = {"gap": gap_table, "gail": gail_table, "rollout_gradient": rollout_table, "left_out": left_out_table}
    return "\n\n".join(table(results[key]) for key, table in (of | {"lead": lead_table}).items() if results.get(key))


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
        seen = row["checkpoints"]
        checkpoints = "" if seen is None else f"{seen['best']:.1f}, {seen['last']:.1f}"
        lines.append((name, *_alone(row), *_distances(row), checkpoints))
    return markdown_table(heads, lines)


def rollout_table(rows: Mapping[str, Any]) -> str:
    """The drivers of the rollout gradient."""
    heads = (
        *("driver", "alone within limits: RMSE [m]", "MAD [m]", "collided [%]", "line run [%]"),
        *(f"all predicted: {DISTANCES[0]}", *DISTANCES[1:], "least speed on an empty road, to the calibrated IDM's"),
    )
    return markdown_table(
        heads, [(name, *_alone(row), *_distances(row), f"{row['empty_road']:.2f}") for name, row in rows.items()]
    )


def left_out_table(rows: Mapping[str, Any]) -> str:
    """Who did not learn from a place beside who did, there."""
    heads = (
        *("until last seen, at", "left out: RMSE [m]", "MAD [m]", "trained there too: RMSE [m]", "MAD [m]"),
        f"RMSE to that, at most {MOST_LEFT_OUT:g}",
    )
    lines = []
    for place, row in rows.items():
        ratio = row["left_out"]["distance_rmse_to_everywhere"]
        met = "met" if ratio["value"] <= MOST_LEFT_OUT else "**missed**"
        cells = [in_unit(row[one][f"distance_{key}"]) for one in ("left_out", "everywhere") for key in ("rmse", "mad")]
        lines.append((place, *cells, f"{in_unit(ratio)}: {met}"))
    return markdown_table(heads, lines)


def lead_table(rows: Mapping[str, Any]) -> str:
    """Who leads."""
    heads = ("whom to follow", "crossing order right [%]", *DISTANCES)
    return markdown_table(heads, [(name, in_percent(row["order"]), *_distances(row)) for name, row in rows.items()])


def _alone(row: Mapping[str, Any]) -> list[str]:
    alone = row["alone"]
    shares = [f"{100.0 * alone[key]:.1f}" for key in ("collisions", "line_runs")]
    return [*(f"{alone[key]:.1f}" for key in ("rmse", "mad")), *shares]


def _distances(row: Mapping[str, Any]) -> list[str]:
    at_10s = [in_unit(row["at_10s"][key], form=".1f") for key in ("distance_rmse", "distance_mad")]
    last = [in_unit(row["until_last_seen"][key], form=".1f") for key in UNTIL_LAST_SEEN]
    return [*at_10s, *last, speeds_behind(row)]
