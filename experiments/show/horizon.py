"""Shows how far predictions are off over 10 s, in distance and in time loss."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from experiments.show.style import set_style
from experiments.show.tables import in_unit, markdown_table
from intersection_env.evaluation.moments import HORIZONS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

QUANTITIES = ("distance", "time_loss")
ERRORS = ("distance_rmse", "distance_mad", "time_loss_rmse", "time_loss_q80")
"""Those after 10 s that tables show."""
UNTIL_LAST_SEEN = ("distance_rmse", "distance_mad", "distance_bias")
"""Those until last seen."""
MODELS = {
    "constant_velocity": "constant velocity",
    "idm": "critical gaps, IDM",
    "gap": "gap network, IDM",
    "idm_calibrated": "gap network, calibrated IDM",
    "ppo": "gap network, PPO",
    "gail": "gap network, GAIL",
    "rollout_gradient": "gap network of its own, rollout gradient",
}
"""Those that ship: who decides about gaps, and who drives."""


def errors_text(results: Mapping[str, Any]) -> str:
    """Each model's errors after 4 and 10 s and until last seen with their intervals, as text."""
    lines = []
    for key, time in (("at_4s", "4 s"), ("at_10s", "10 s")):
        heads = ("RMSE [m]", "MAD [m]", "time loss RMSE [s]", "80 % [s]")
        lines.append(" ".join((f"{time + ', recorded':<26}", *(f"{head:>20}" for head in heads))))
        for name, row in results[key].items():
            lines.append(f"{name:<26} " + " ".join(f"{in_unit(row[one]):>20}" for one in ERRORS))
    return "\n".join([*lines, *_last_seen_lines("until last seen", results)])


def order_handed_in_text(results: Mapping[str, Any]) -> str:
    """The errors until last seen with the recorded order handed in, and how often that was refused, as text."""
    informed = results["order_handed_in"]
    lines = [f"{name}: refused in {count} moments" for name, count in informed["refused"].items()]
    return "\n".join([*_last_seen_lines("recorded order handed in", informed), *lines])


def _last_seen_lines(title: str, results: Mapping[str, Any]) -> list[str]:
    heads = ("RMSE [m]", "MAD [m]", "bias [m]", "behind, recorded [m/s]")
    lines = [" ".join((f"{title:<26}", *(f"{head:>22}" for head in heads)))]
    for name, row in results["until_last_seen"].items():
        cells = [*(in_unit(row[key]) for key in UNTIL_LAST_SEEN), speeds_behind(results["models"][name])]
        lines.append(" ".join((f"{name:<26}", *(f"{cell:>22}" for cell in cells))))
    return lines


def speeds_behind(of_model: Mapping[str, Any]) -> str:
    """Mean speeds behind the junction, predicted and recorded [m/s]; nothing where nobody is there."""
    speeds = [of_model["speed_behind"][key] for key in ("predicted", "recorded")]
    return ", ".join("-" if one is None else f"{one:.1f}" for one in speeds)


def errors_table(errors: pd.DataFrame) -> str:
    """The errors of the models that ship over the horizon, of vehicles recorded at the start and at the horizon.

    Args:
        errors: as `evaluate` gives them.
    """
    recorded = errors[errors["population"] == "recorded"].set_index(["model", "horizon"]).to_dict("index")
    rows, measured = [], _measured(errors)
    for model, name in measured.items():
        of_model = [recorded[model, horizon] for horizon in HORIZONS]
        cells = [f"{row['rmse']:.1f} / {row['mad']:.1f}, {row['time_loss_rmse']:.1f}" for row in of_model]
        rows.append((name, *cells))
    counts = [f"{recorded[next(iter(measured)), horizon]['count']:.0f}" for horizon in HORIZONS]
    heads = ("RMSE / MAD [m], time loss RMSE [s]", *(f"{horizon:.0f} s" for horizon in HORIZONS))
    return markdown_table(heads, [*rows, ("samples", *counts)])


def until_last_seen_table(errors: pd.DataFrame) -> str:
    """The errors of everyone recorded at the start when it was last seen, by when that was, and speeds behind it all.

    Args:
        errors: as `evaluate` gives them.
    """
    indexed = errors.set_index(["model", "population", "horizon"]).to_dict("index")
    rows, measured = [], _measured(errors)
    for model, name in measured.items():
        parts = [indexed.get((model, "last_seen", horizon)) for horizon in HORIZONS]
        everybody = indexed[model, "until_last_seen", HORIZONS[-1]]
        cells = ["" if row is None else _signed(row) for row in (*parts, everybody)]
        speeds = (f"{everybody[key]:.1f}" for key in ("speed_behind", "recorded_speed_behind"))
        rows.append((name, *cells, ", ".join(speeds)))
    first = next(iter(measured))
    found = [indexed.get((first, "last_seen", horizon)) for horizon in HORIZONS]
    found.append(indexed[first, "until_last_seen", HORIZONS[-1]])
    counts = ("0" if row is None else f"{row['count']:.0f}" for row in found)
    heads = ("RMSE / MAD / bias [m], last seen", *(f"to {horizon:.0f} s" for horizon in HORIZONS), "at any time")
    return markdown_table((*heads, "behind the junction, recorded [m/s]"), [*rows, ("samples", *counts, None)])


def _measured(errors: pd.DataFrame) -> dict[str, str]:
    """Those of `MODELS` that have rows."""
    return {model: name for model, name in MODELS.items() if model in set(errors["model"])}


def _signed(row: Mapping[Any, Any]) -> str:
    return f"{row['rmse']:.1f} / {row['mad']:.1f} / {row['bias']:+.1f}"


def plot_errors(results: Mapping[str, Any], names: Mapping[str, str]) -> Figure:
    """Distance and time-loss error over the horizon, vehicles recorded at the start.

    Args:
        results: as `horizon_results` gives them.
        names: models to draw, in this order, and what to call them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 2.9), layout="constrained")
    for axes, quantity, label in zip(
        figure.subplots(1, 2), QUANTITIES, ("distance error [m]", "time loss error [s]"), strict=True
    ):
        for k, (model, name) in enumerate(names.items()):
            curves = results["models"][model]["recorded"][quantity]
            color = f"C{k}"
            axes.plot(results["time"], curves["rmse"], color=color, label=name, linewidth=1.4)
            axes.plot(results["time"], curves["mad"], color=color, linestyle="--", linewidth=1.0)
        axes.set_xlabel("horizon [s]")
        axes.set_ylabel(label)
        axes.set_xlim(0.0, 10.0)
        axes.set_ylim(bottom=0.0)
        set_style(axes)
    axes.plot([], [], color="#555", linewidth=1.4, label="RMSE")
    axes.plot([], [], color="#555", linestyle="--", linewidth=1.0, label="MAD")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    return figure
