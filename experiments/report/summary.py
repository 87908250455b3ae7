"""The figures of `make reproduce` in one file, whose names stay as they are: `summary.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MODELS = ("gail", "ppo", "rollout_gradient", "idm", "idm_calibrated", "constant_velocity", "sumo")
"""`idm` is the paper's: its parameters, with our gap network. `sumo` lacks where SUMO is not installed."""

Json = Mapping[str, Any]


def summary(results: Json, about: Json, seconds: Mapping[str, float]) -> dict[str, Any]:
    """The content of `summary.json`.

    Args:
        results: contents of the results files, by their names.
        about: the recordings.
        seconds: by stage, what it took.

    Returns:
        Shares between 0 and 1, metres, seconds. "data", of validation: "gap", with recorded foes, "order" of pairs
        recorded at the start, "distance" and "time_loss" of vehicles recorded at the start and at 10 s, and the
        distance's errors "until_last_seen"; "default", the default policy's name; "closed_loop", PPO's run of 2000 s
        with the gap network; "runtime" and "seconds".
    """
    at_10s = {name: row for name, row in results["horizon_validation"]["at_10s"].items() if name in MODELS}
    run = results["closed_loop"]["drivers"]["ppo"]["gap"]
    return {
        "data": {key: about[key] for key in ("name", "recordings_train", "recordings_validation", "hours")},
        "gap": _gap(results["gap_validation"]["foes"]["recorded"]),
        "order": _order(results["order_validation"]["recorded"]["models"]),
        "distance": {
            name: {"rmse_10s": row["distance_rmse"]["value"], "mad_10s": row["distance_mad"]["value"]}
            for name, row in at_10s.items()
        },
        "time_loss": {
            name: {"rmse_10s": row["time_loss_rmse"]["value"], "q80_10s": row["time_loss_q80"]["value"]}
            for name, row in at_10s.items()
        },
        "default": results["default"]["default"],
        "until_last_seen": {
            name: {key: row[f"distance_{key}"]["value"] for key in ("rmse", "mad", "bias")}
            for name, row in results["horizon_validation"]["until_last_seen"].items()
            if name in MODELS
        },
        "closed_loop": {
            "reward": run["reward"],
            "collisions_per_second_per_agent": run["collisions"],
            "mean_speed": run["speed"],
            "duration_s": run["seconds"],
        },
        "runtime": _runtime(results["runtime"]),
        "seconds": dict(seconds),
    }


def _gap(foes: Json) -> dict[str, Any]:
    models = foes["models"]
    network = models["network"]
    lead = models["sumo"]["network_minus"]["accuracy"]
    return {
        "frame_accuracy": network["accuracy"]["value"],
        "balanced_accuracy": _value(network["balanced_accuracy"]),
        "pair_accuracy": _value(network["pair_accuracy"]),
        "base_rate": foes["base_rate"]["value"],
        "sumo_rule": models["sumo"]["accuracy"]["value"],
        "sumo_kinematic": models["sumo_kinematic"]["accuracy"]["value"],
        "critical_gap": models["critical_gap"]["accuracy"]["value"],
        "logistic": models["logistic"]["accuracy"]["value"],
        "interval": {
            "frame_accuracy": [network["accuracy"]["low"], network["accuracy"]["high"]],
            "minus_sumo_rule": [lead["low"], lead["high"]],
        },
    }


def _value(figure: Json | None) -> Any:
    """None where there is nothing to measure: no yielder went first, say."""
    return None if figure is None else figure["value"]


def _order(models: Json) -> dict[str, float]:
    others = (name for name in ("rollout_gradient", "priority_first", "sumo_rule") if name in models)
    names = {"model": "gail"} | {name: name for name in others}
    return {key: models[name]["accuracy"]["value"] for key, name in names.items()}


def _runtime(results: Json) -> dict[str, Any]:
    models = results["models"]
    return {
        "one_scenario_ms": {size: row["mean"] for size, row in models["ours"]["vehicles"].items()},
        "batch_ms": {size: row["mean"] for size, row in models["ours, batch"]["vehicles"].items()},
        "maneuvers_per_cycle": results["maneuvers_per_cycle"],
        "quadratic_ms": results["fits"]["ours"]["mean"]["quadratic"]["coefficients"],
        "isa": results["isa"],
    }
