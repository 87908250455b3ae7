"""The paper's headline figures with ours beside them, and whether ours reach the bars that we set ourselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from experiments.show.tables import in_percent, in_unit

Json = Mapping[str, Any]

MEASURED_AS = {"gap": "idm"}
"""Policies that measurements know by another name: the paper's IDM with our gap network."""

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
    """The paper's figures in its order."""
    gap = results["gap_validation"]["foes"]["recorded"]["models"]
    lead = gap["sumo"]["network_minus"]["accuracy"]
    commands = {
        name: f"python -m experiments.{name} --split validation --out out"  # not into the results of `make reproduce`
        for name in ("gap", "crossing_order", "horizon")
    }
    yield Row("gap decision right, frames", "94.5 %", percent(gap["network"]["accuracy"]), command=commands["gap"])
    yield Row("the same by SUMO's rule", "86.0 %", percent(gap["sumo"]["accuracy"]), command=commands["gap"])
    yield Row(
        "network minus SUMO's rule", "8.5 %", percent(lead), "above 0, all of it", lead["low"] > 0.0, commands["gap"]
    )
    order = results["order_validation"]["recorded"]["models"]["gail"]
    right = order["accuracy"]
    order_command = commands["crossing_order"]
    met = right["value"] >= 0.836
    yield Row("crossing order right", "83.6 %", percent(right), "at least 83.6 %", met, order_command)
    for other, name in (("priority_first", "priority first"), ("sumo_rule", "SUMO's rule")):
        minus = order["minus"][other]
        yield Row(f"that minus {name}", "", percent(minus), "above 0", minus["value"] > 0.0, order_command)
    gail = results["horizon_validation"]["at_10s"]["gail"]
    for key, what, paper, unit in (
        ("distance_rmse", "distance RMSE at 10 s", "14 m", "m"),
        ("distance_mad", "distance MAD at 10 s", "6 m", "m"),
    ):
        yield Row(what, paper, in_unit(gail[key], unit), command=commands["horizon"])
        figure = what.split()[1]
        paper_ratio = {"distance_rmse": "0.6", "distance_mad": "0.8"}[key]
        to_idm, to_best = gail[f"{key}_to_idm"], gail[f"{key}_to_idm_calibrated"]
        met = to_idm["value"] <= float(paper_ratio)
        yield Row(f"... its {figure} to the IDM's", paper_ratio, in_unit(to_idm), f"at most {paper_ratio}", met)
        met = to_best["value"] <= 0.8
        yield Row(
            f"... its {figure} to the calibrated IDM's", "", in_unit(to_best), "at most 0.8", met, commands["horizon"]
        )
    lost = gail["time_loss_rmse"]
    met = lost["value"] <= 1.2
    yield Row("time-loss RMSE at 10 s", "2.0 s", in_unit(lost, "s"), "at most 1.2 s", met, commands["horizon"])
    yield Row("time-loss 80 % quantile", "2.3 s", in_unit(gail["time_loss_q80"], "s"), command=commands["horizon"])
    yield from _until_last_seen_rows(results["horizon_validation"], results["default"]["default"], commands["horizon"])
    yield from _closed_loop_rows(results["closed_loop"]["drivers"]["ppo"]["gap"])
    yield from _runtime_rows(results["runtime"])


def _until_last_seen_rows(horizon: Json, default: str, command: str) -> Iterator[Row]:
    """The default's errors, of everyone recorded at the start when it was last seen, beside constant velocity's."""
    row = horizon["until_last_seen"][MEASURED_AS.get(default, default)]
    for key, name in (("rmse", "RMSE"), ("mad", "MAD")):
        of_default = in_unit(row[f"distance_{key}"], "m")
        yield Row(f"until last seen, {name} of the default ({default})", "", of_default, command=command)
        ratio = row[f"distance_{key}_to_constant_velocity"]
        met = ratio["value"] < 1.0
        yield Row(f"... its {name} to constant velocity's", "", in_unit(ratio), "below 1", met, command)
    yield Row("... its bias", "", in_unit(row["distance_bias"], "m"), command=command)


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
