"""The paper's headline figures with ours beside them, and whether ours reach the bars that we set ourselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from experiments.show.forecast import BOOSTING, JOINT
from experiments.show.tables import in_percent, in_unit

Json = Mapping[str, Any]

MEASURED_AS = {"gap": "idm"}
"""Policies that measurements know by another name: the paper's IDM with our gap network."""

COMPARED = ("gail", "gap", "idm_calibrated")
"""Policies that the paper's figures are of, or taken relative to: as the default they need no second row."""
ROLLOUTS = "rollout_gradient"
COMMANDS = {
    name: f"python -m experiments.{name} --split validation --out out"  # not into the results of `make reproduce`
    for name in ("gap", "crossing_order", "horizon")
}
HORIZON = COMMANDS["horizon"]

percent = partial(in_percent, unit="%")


@dataclass(frozen=True)
class Row:
    """One figure of the paper, ours beside it, and the bar we set ourselves."""

    what: str
    paper: str
    ours: str
    bar: str = ""
    met: bool | None = None
    command: str = "make reproduce"

    def cells(self) -> tuple[str, ...]:
        """As a table shows it."""
        verdict = {None: "", True: "met", False: "**missed**"}[self.met]
        return self.what, self.paper, self.ours, f"{self.bar}: {verdict}" if self.bar else "", f"`{self.command}`"


def headlines(results: Json) -> Iterator[Row]:
    """The paper's figures in its order, of its driver and of a default that learned to drive too; then ours."""
    gap = results["gap_validation"]["foes"]["recorded"]["models"]
    lead = gap["sumo"]["network_minus"]["accuracy"]
    yield Row("gap decision right, frames", "94.5 %", percent(gap["network"]["accuracy"]), command=COMMANDS["gap"])
    yield Row("the same by SUMO's rule", "86.0 %", percent(gap["sumo"]["accuracy"]), command=COMMANDS["gap"])
    yield Row(
        "network minus SUMO's rule", "8.5 %", percent(lead), "above 0, all of it", lead["low"] > 0.0, COMMANDS["gap"]
    )
    order = results["order_validation"]["recorded"]["models"]
    default = results["default"]["default"]
    beside = f", default ({default})" if default not in COMPARED else None
    yield _order_row(order["gail"])
    for other, name in (("priority_first", "priority first"), ("sumo_rule", "SUMO's rule")):
        minus = order["gail"]["minus"][other]
        met = minus["value"] > 0.0
        yield Row(f"that minus {name}", "", percent(minus), "above 0", met, COMMANDS["crossing_order"])
    if beside:
        yield _order_row(order[default], beside)
    at_10s = results["horizon_validation"]["at_10s"]
    yield from _at_10s_rows(at_10s["gail"])
    yield Row("time-loss 80 % quantile", "2.3 s", in_unit(at_10s["gail"]["time_loss_q80"], "s"), command=HORIZON)
    if beside:
        yield from _at_10s_rows(at_10s[default], beside)
    yield from _until_last_seen_rows(results["horizon_validation"], default)
    if ROLLOUTS in at_10s:
        yield from _rollout_rows(results["horizon_validation"], results["replay_validation"]["within_limits"])
    yield from _forecast_rows(results)
    yield from _closed_loop_rows(results["closed_loop"]["drivers"]["ppo"]["gap"])
    yield from _runtime_rows(results["runtime"])


def _order_row(model: Json, whose: str = "") -> Row:
    right = model["accuracy"]
    met = right["value"] >= 0.836
    what = f"crossing order right{whose}"
    return Row(what, "83.6 %", percent(right), "at least 83.6 %", met, COMMANDS["crossing_order"])


def _at_10s_rows(model: Json, whose: str = "") -> Iterator[Row]:
    for key, figure, paper, paper_ratio in (("rmse", "RMSE", "14 m", "0.6"), ("mad", "MAD", "6 m", "0.8")):
        ours = in_unit(model[f"distance_{key}"], "m")
        yield Row(f"distance {figure} at 10 s{whose}", paper, ours, command=HORIZON)
        to_idm, to_best = (model[f"distance_{key}_to_{other}"] for other in ("idm", "idm_calibrated"))
        met = to_idm["value"] <= float(paper_ratio)
        what = f"... its {figure} to the IDM's{whose}"
        yield Row(what, paper_ratio, in_unit(to_idm), f"at most {paper_ratio}", met)
        yield _ratio_row(f"... its {figure} to the calibrated IDM's{whose}", to_best, 0.8)
    lost = model["time_loss_rmse"]
    met = lost["value"] <= 1.2
    yield Row(f"time-loss RMSE at 10 s{whose}", "2.0 s", in_unit(lost, "s"), "at most 1.2 s", met, HORIZON)


def _ratio_row(what: str, ratio: Json, most: float) -> Row:
    return Row(what, "", in_unit(ratio), f"at most {most:g}", ratio["value"] <= most, HORIZON)


def _rollout_rows(horizon: Json, alone: Json) -> Iterator[Row]:
    """The rollout gradient's errors beside others', each with our own bar."""
    name, calibrated = "rollout gradient", "the calibrated IDM's"
    for times, results, bars in (
        ("until last seen", horizon["until_last_seen"], {"rmse": 0.85, "mad": 0.45}),
        ("at 4 s", horizon["at_4s"], {"rmse": 0.7, "mad": 0.4}),
    ):
        for key, most in bars.items():
            ratio = results[ROLLOUTS][f"distance_{key}_to_idm_calibrated"]
            yield _ratio_row(f"{name}, {times}: {key.upper()} to {calibrated}", ratio, most)
    informed = horizon["order_handed_in"]["until_last_seen"][ROLLOUTS]
    calibrated_alone = horizon["until_last_seen"]["idm_calibrated"]["distance_rmse"]
    share = informed["distance_rmse"]["value"] / calibrated_alone["value"]
    what = f"{name}, until last seen, recorded order handed in: RMSE to {calibrated} without it"
    yield Row(what, "", f"{share:.2f}", "at most 0.7", share <= 0.7, HORIZON)
    ratio = in_unit(informed["distance_rmse_to_idm_calibrated"])
    yield Row(f"... to {calibrated} with it", "", ratio, command=HORIZON)
    for key, time, most in (("at_4s", "4 s", 0.45), ("at_10s", "10 s", 0.9)):
        share = alone[ROLLOUTS][key]["rmse"] / alone["gail"][key]["rmse"]
        what = f"{name}, alone within limits, recorded order, {time}: RMSE to GAIL's"
        yield Row(what, "", f"{share:.2f}", f"at most {most:g}", share <= most)


def _until_last_seen_rows(horizon: Json, default: str) -> Iterator[Row]:
    """The default's errors, of everyone recorded at the start when it was last seen, beside constant velocity's."""
    row = horizon["until_last_seen"][MEASURED_AS.get(default, default)]
    for key, name in (("rmse", "RMSE"), ("mad", "MAD")):
        of_default = in_unit(row[f"distance_{key}"], "m")
        yield Row(f"until last seen, {name} of the default ({default})", "", of_default, command=HORIZON)
        ratio = row[f"distance_{key}_to_constant_velocity"]
        met = ratio["value"] < 1.0
        yield Row(f"... its {name} to constant velocity's", "", in_unit(ratio), "below 1", met, HORIZON)
    yield Row("... its bias", "", in_unit(row["distance_bias"], "m"), command=HORIZON)


def _forecast_rows(results: Json) -> Iterator[Row]:
    """Crossing orders with probabilities, and the predictions of them, each with our own bar."""
    found, command = results["forecast_validation"], "python -m experiments.forecast --split validation --out out"
    for population, of_pairs in found["orders"].items():
        own, boosting = (of_pairs["models"][name] for name in (JOINT, BOOSTING))
        pairs = f"orders with probabilities, {population} pairs"
        for key, other in (("accuracy_minus_sumo", "SUMO's rule"), ("accuracy_minus_priority", "priority first")):
            met = own[key]["low"] > 0.0
            yield Row(f"{pairs}: right, minus {other}", "", percent(own[key]), "above 0, all of it", met, command)
        share = own["brier"]["value"] / boosting["brier"]["value"]
        what = f"{pairs}: Brier score to gradient boosting's"
        yield Row(what, "", f"{share:.2f}", "at most 1.05", share <= 1.05, command)
        error = own["calibration_error"]
        met = error["value"] <= 0.03
        yield Row(f"{pairs}: calibration error", "", in_unit(error, form=".3f"), "at most 0.03", met, command)
    for time in (2, 4, 6, 8, 10):
        held = found["positions"][str(time)]["coverage"]
        met = 0.75 <= held["value"] <= 0.85
        yield Row(f"80 % interval of the position at {time} s holds", "", percent(held), "75 to 85 %", met, command)
    horizon = results["horizon_validation"]
    for name, most, mad in (("most_probable", 0.8, 0.8), ("mean_over_orders", 0.7, None)):
        model, called = f"{ROLLOUTS}_{name}", name.replace("_", " ")
        if model not in horizon["at_10s"]:
            continue
        at_10s, last = (horizon[key][model] for key in ("at_10s", "until_last_seen"))
        to = "distance_rmse_to_idm_calibrated"
        yield _ratio_row(f"{called}, 10 s: RMSE to the calibrated IDM's", at_10s[to], most)
        if mad is not None:
            ratio, lost = at_10s["distance_mad_to_idm_calibrated"], at_10s["time_loss_rmse"]
            yield _ratio_row(f"{called}, 10 s: MAD to the calibrated IDM's", ratio, mad)
            what, met = f"{called}, 10 s: RMSE of the time loss", lost["value"] <= 1.2
            yield Row(what, "", in_unit(lost, "s"), "at most 1.2 s", met, HORIZON)
        yield _ratio_row(f"{called}, until last seen: RMSE to the calibrated IDM's", last[to], 0.75)


def _closed_loop_rows(run: Json) -> Iterator[Row]:
    command = "python -m experiments.closed_loop --out out"
    reward, collisions = run["reward"], run["longer"]["collisions"]
    yield Row("PPO, 2000 s: mean reward", "0.4", f"{reward:.2f}", "at least 0.4", reward >= 0.4, command)
    met = run["collisions"] < 1e-3
    once = f"{run['collisions']:.1e}"
    yield Row("... collisions a second and agent", "below 1e-3", once, "below 1e-3", met, command)
    longer = in_unit(collisions, form=".1e")
    yield Row(f"... the same over {run['longer']['seconds']:.0f} s", "", longer, command=command)
    met = run["speed"] >= 6.0
    yield Row("... mean speed", "6 m/s", f"{run['speed']:.1f} m/s", "at least 6 m/s", met, command)


def _runtime_rows(runtime: Json) -> Iterator[Row]:
    one, paper = runtime["models"]["ours"]["vehicles"]["15"]["mean"], runtime["paper"]
    command = "python -m experiments.runtime --out out"
    yield Row("15 vehicles, 10 s, one core", "below 3.5 ms", f"{one:.3f} ms", "below 3.5 ms", one < 3.5, command)
    count = runtime["maneuvers_per_cycle"]
    wanted = paper["maneuvers_per_cycle"]
    yield Row("maneuvers in 200 ms", f"over {wanted}", f"{count:,}", f"over {wanted}", count > wanted, command)
