"""Tables that the report alone has, of the models by their names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from experiments.show.horizon import ERRORS
from experiments.show.tables import in_unit, markdown_table

NAMES = {
    "gail": "GAIL",
    "ppo": "PPO",
    "idm": "IDM (paper)",
    "idm_calibrated": "IDM, calibrated",
    "constant_velocity": "constant velocity",
    "idm_critical_gap": "IDM, critical gaps",
    "sumo": "SUMO",
}

Json = Mapping[str, Any]

report_table = partial(markdown_table, rule=" --- ")


def called(name: str) -> str:
    """A model's name; `gail_1` is GAIL's with seed 1."""
    model, _, seed = name.rpartition("_")
    return f"{NAMES[model]}, seed {seed}" if model in NAMES and seed.isdecimal() else NAMES.get(name, name)


def errors_table(found: Json) -> str:
    """Errors after 10 s of vehicles recorded at the start and then; and who is missing."""
    heads = ("", "RMSE [m]", "MAD [m]", "time loss RMSE [s]", "80 % [s]", "RMSE to calibrated IDM's")
    rows = []
    for name, row in found["at_10s"].items():
        ratio = in_unit(row.get("distance_rmse_to_idm_calibrated"))
        rows.append((called(name), *(in_unit(row[key]) for key in ERRORS), ratio))
    return report_table(heads, rows) + "".join(f"\n\n{name}: {why}." for name, why in found["missing"].items())


def extrapolated_table(found: Json) -> str:
    """Errors after 10 s of vehicles that are extrapolated at the start."""
    rows = []
    for name in (one for one in NAMES if one in found["models"]):
        curves = found["models"][name]["extrapolated"]
        if not curves["count"][-1]:
            continue
        figures = [curves["distance"]["rmse"], curves["distance"]["mad"], curves["time_loss"]["rmse"]]
        rows.append((NAMES[name], *(f"{one[-1]:.2f}" for one in figures), str(curves["count"][-1])))
    return report_table(("", "RMSE [m]", "MAD [m]", "time loss RMSE [s]", "samples"), rows)


def replay_table(found: Json) -> str:
    """Errors of drivers alone among recorded vehicles."""
    heads = ("", "RMSE [m]", "MAD [m]", "vehicles", "collided", "line run, of held steps")
    rows = [
        (
            called(name),
            *(f"{row[key]:.2f}" for key in ("rmse", "mad")),
            str(row["count"]),
            *(f"{100.0 * row[key]:.2f} %" for key in ("collisions", "line_runs")),
        )
        for name, row in found.items()
    ]
    return report_table(heads, rows)


def closed_loop_table(found: Json) -> str:
    """The longer runs in the closed loop."""
    rows = []
    for name, of_driver in found["drivers"].items():
        for gap, run in of_driver.items():
            longer = run["longer"]
            figures = [f"{longer[key]:.2f}" for key in ("reward", "reward_between_collisions")]
            collisions = in_unit(longer["collisions"], form=".1e")
            rows.append((called(name), gap, *figures, collisions, f"{longer['speed']:.1f}"))
    heads = ("", "gaps by", "reward", "between collisions", "collisions a second and agent", "speed [m/s]")
    return report_table(heads, rows)
