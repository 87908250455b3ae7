"""Tables that the report alone has, of the models by their names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from experiments.show.horizon import UNTIL_LAST_SEEN, speeds_behind
from experiments.show.tables import in_unit, markdown_table

NAMES = {
    "gail": "GAIL",
    "ppo": "PPO",
    "rollout_gradient": "rollout gradient",
    "idm": "IDM (paper)",
    "idm_calibrated": "IDM, calibrated",
    "constant_velocity": "constant velocity",
    "idm_critical_gap": "IDM, critical gaps",
    "sumo": "SUMO",
    "gap": "IDM (paper)",
    "rollout_gradient_patience_kept": "rollout gradient, patience kept",
    "rollout_gradient_most_probable": "rollout gradient, most probable order",
    "rollout_gradient_mean_over_orders": "rollout gradient, mean over orders",
}

Json = Mapping[str, Any]

report_table = partial(markdown_table, rule=" --- ")


def called(name: str) -> str:
    """A model's name; `gail_1` is GAIL's with seed 1."""
    model, _, seed = name.rpartition("_")
    return f"{NAMES[model]}, seed {seed}" if model in NAMES and seed.isdecimal() else NAMES.get(name, name)


def errors_table(found: Json, at: str = "at_10s") -> str:
    """Errors after 10 s, or "at_4s", of vehicles recorded at the start and then; and who is missing."""
    heads = (
        *("", "RMSE [m]", "MAD [m]", "bias [m]", "time loss RMSE [s]", "80 % [s]", "RMSE to calibrated IDM's"),
        "RMSE to constant velocity's",
    )
    keys = ("distance_rmse", "distance_mad", "distance_bias", "time_loss_rmse", "time_loss_q80")
    rows = []
    for name, row in found[at].items():
        ratios = (in_unit(row.get(f"distance_rmse_to_{other}")) for other in ("idm_calibrated", "constant_velocity"))
        rows.append((called(name), *(in_unit(row[key]) for key in keys), *ratios))
    return report_table(heads, rows) + "".join(f"\n\n{name}: {why}." for name, why in found["missing"].items())


def until_last_seen_table(found: Json) -> str:
    """Errors of everyone recorded at the start when it was last seen, and speeds behind the junction."""
    heads = ("", "RMSE [m]", "MAD [m]", "bias [m]", "RMSE to constant velocity's", "MAD to constant velocity's")
    rows = []
    for name, row in found["until_last_seen"].items():
        ratios = (in_unit(row.get(f"distance_{key}_to_constant_velocity")) for key in ("rmse", "mad"))
        cells = (*(in_unit(row[key]) for key in UNTIL_LAST_SEEN), *ratios, speeds_behind(found["models"][name]))
        rows.append((called(name), *cells))
    return report_table((*heads, "behind the junction, recorded [m/s]"), rows)


def order_handed_in_table(found: Json) -> str:
    """The same errors with the recorded order handed in, and from how many moments it was refused."""
    informed = found["order_handed_in"]
    heads = ("", "RMSE [m]", "MAD [m]", "bias [m]", "RMSE to the calibrated IDM's, likewise", "MAD to it")
    rows = []
    for name, row in informed["until_last_seen"].items():
        ratios = (in_unit(row.get(f"distance_{key}_to_idm_calibrated")) for key in ("rmse", "mad"))
        cells = (*(in_unit(row[key]) for key in UNTIL_LAST_SEEN), *ratios, speeds_behind(informed["models"][name]))
        count = f"{informed['refused'][name]} of {found['moments']}"
        rows.append((f"{called(name)}, recorded order handed in", *cells, count))
    return report_table((*heads, "behind the junction, recorded [m/s]", "moments refused"), rows)


def last_seen_table(found: Json) -> str:
    """The same errors by when who was scored was last seen."""
    some = next(iter(found["models"].values()))["last_seen"]
    rows = []
    for name, of_model in found["models"].items():
        errors = of_model["last_seen"]["distance"]
        figures = zip(*(errors[key] for key in ("rmse", "mad", "bias")), strict=True)
        rows.append((called(name), *("" if one[0] is None else " / ".join(f"{x:.1f}" for x in one) for one in figures)))
    heads = ("RMSE / MAD / bias [m], last seen", *(f"to {horizon:.0f} s" for horizon in some["horizon"]))
    return report_table(heads, [*rows, ("samples", *map(str, some["count"]))])


def default_table(found: Json) -> str:
    """What the default was chosen by: each policy's errors until last seen, and what the gates say."""
    heads = (
        *("", "RMSE [m]", "MAD [m]", "bias [m]", "least speed on an empty road, to the calibrated IDM's"),
        *("disobeys", "collisions [% of predictions]", "may be the default"),
    )
    rows = []
    for name, row in found["policies"].items():
        verdict = "no" if row["refusals"] else "**is the default**" if name == found["default"] else "yes"
        errors = (f"{row['until_last_seen'][key]:.2f}" for key in ("rmse", "mad", "bias"))
        share = f"{row['empty_road']:.2f}"
        rows.append((called(name), *errors, share, str(row["disobeys"]), f"{100.0 * row['collisions']:.1f}", verdict))
    steady = (f"{found['constant_velocity'][key]:.2f}" for key in ("rmse", "mad", "bias"))
    return report_table(heads, [*rows, (called("constant_velocity"), *steady, "", "", "", "")])


def extrapolated_table(found: Json) -> str:
    """Errors after 10 s of vehicles that are extrapolated at the start."""
    rows = []
    for name in (one for one in NAMES if one in found["models"]):
        curves = found["models"][name]["extrapolated"]
        if not curves["count"][-1]:
            continue
        distance, lost = curves["distance"], curves["time_loss"]
        figures = [distance["rmse"], distance["mad"], distance["bias"], lost["rmse"]]
        rows.append((NAMES[name], *(f"{one[-1]:.2f}" for one in figures), str(curves["count"][-1])))
    return report_table(("", "RMSE [m]", "MAD [m]", "bias [m]", "time loss RMSE [s]", "samples"), rows)


def replay_table(found: Json) -> str:
    """Errors of drivers alone among recorded vehicles, after 4 and 10 s, without a prediction's limits and within."""
    heads = (
        *("", "4 s: RMSE [m]", "MAD [m]", "vehicles", "10 s: RMSE [m]", "MAD [m]", "vehicles"),
        *("collided within 10 s", "line run, of held steps"),
    )
    rows = []
    for key, said in (("freely", ""), ("within_limits", ", within limits")):
        for name, row in found[key].items():
            cells = [cell for time in ("at_4s", "at_10s") for cell in _of_replay(row[time])]
            shares = (f"{100.0 * row['at_10s'][share]:.2f} %" for share in ("collisions", "line_runs"))
            rows.append((f"{called(name)}{said}", *cells, *shares))
    return report_table(heads, rows)


def _of_replay(row: Json) -> list[str]:
    return [*("" if row[key] is None else f"{row[key]:.2f}" for key in ("rmse", "mad")), str(row["count"])]


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
