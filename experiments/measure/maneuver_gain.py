"""How many crossing orders are feasible, and how much time the best of them saves, by how many vehicles cooperate.

python -m experiments.maneuver_gain --figure out/maneuvers.svg    on the development recordings
python -m experiments.maneuver_gain --split validation            for the report, once

Gains are predicted, not driven: of the best safe order against no intervention, over 10 s.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.results_files import write_result
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned
from intersection_env.plots.files import write_figure
from intersection_env.prediction.maneuvers import COUNT_LIMIT, LIMIT, WORTHWHILE_GAIN, rank_maneuvers
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Samples = Mapping[str, NDArray[np.float64]]

SHARES = tuple(tenth / 10 for tenth in range(1, 11))  # of the vehicles that take instructions
GAIN_COLOUR, ORDERS_COLOUR, QUIET = "#2f6da8", "#b5483a", "#8a8a86"


class Best(NamedTuple):
    """What the best safe order of one moment brings.

    gain: against no intervention [s], 0 where none is better. worthwhile: whether it is worth executing.
    time_loss: of all vehicles without intervention [s]. orders: how many are feasible, as far as they are counted.
    """

    gain: float
    worthwhile: bool
    time_loss: float
    orders: int


def cooperative_sets(ids: Sequence[str], generator: np.random.Generator) -> list[list[str]]:
    """The vehicles that cooperate at each of `SHARES`: each does with that probability, and at all greater ones."""
    drawn = generator.random(len(ids))
    return [[id for id, chance in zip(ids, drawn, strict=True) if chance < share] for share in SHARES]


def best_order(predictor: Predictor, traffic: Traffic, cooperative: Sequence[str], limit: int = LIMIT) -> Best:
    """The best of `rank_maneuvers`, of so many orders at most."""
    ranked = rank_maneuvers(predictor, traffic, cooperative, limit=limit)
    safe = ranked[ranked.safe]
    return Best(
        # where no intervention is unsafe, a safe order may lose time
        gain=max(0.0, float(safe.gain.iloc[0])) if len(safe) else 0.0,
        worthwhile=bool(ranked.worth_executing.any()),
        time_loss=float(ranked.total_time_loss[~ranked.intervention].iloc[0]),
        orders=int(ranked.intervention.sum()) + int(ranked.attrs["left_out"]),
    )


def maneuver_results(predictor: Predictor, moments: Sequence[Moment], seed: int, limit: int = LIMIT) -> dict[str, Any]:
    """How many orders are feasible and what the best safe one saves, with intervals over recordings.

    Args:
        predictor: who drives.
        moments: each with an open conflict, as `contested` gives them.
        seed: of who cooperates, drawn anew in each moment.
        limit: orders predicted at most in a moment, those nearest to no intervention first.

    Returns:
        `orders`, with all vehicles cooperating: `median`, `p90`, `max`, `counted_to` (no count is above), `counts`
        (moment,). By share of cooperative vehicles, in `shares`: `mean_gain` [s] of all moments, `worthwhile` (share
        of moments with an order worth executing), `mean_gain_worthwhile` [s] of those moments (None without any),
        `saved` (the gains' sum as a share of the time lost without intervention).

    Raises:
        ValueError: no moments, or a limit below 1.
    """
    if not moments:
        raise ValueError("no moments with an open conflict to search for orders in")
    generator = np.random.default_rng(seed)
    found = []
    for moment in moments:
        sets = cooperative_sets(moment.traffic.ids, generator)
        found.append([best_order(predictor, moment.traffic, cooperative, limit) for cooperative in sets])
    orders = np.array([row[-1].orders for row in found])
    recording = np.array([moment.scene.recording for moment in moments])
    columns = np.array([[(one.gain, one.worthwhile, one.time_loss) for one in row] for row in found])
    names = sorted(set(recording.tolist()))
    shares = []
    for k, share in enumerate(SHARES):
        shares.append({"share": share, **_figures({name: columns[recording == name, k] for name in names})})
    median, p90 = np.quantile(orders, [0.5, 0.9]).tolist()
    return {
        "policy": predictor.name,
        "seed": seed,
        "limit": limit,
        "moments": len(moments),
        "recordings": len(names),
        "orders": {
            "median": median,
            "p90": p90,
            "max": int(orders.max()),
            "counted_to": limit + COUNT_LIMIT,
            "counts": orders.tolist(),
        },
        "shares": shares,
    }


def _figures(samples: Samples) -> dict[str, Any]:
    """Of gain, whether it is worthwhile, and time loss without intervention: (moment, 3) by recording."""
    worthwhile = {name: one[one[:, 1] > 0.0, :1] for name, one in samples.items()}
    return {
        "mean_gain": _rounded(interval(samples, lambda rows: float(rows[:, 0].mean()))),
        "worthwhile": _rounded(interval(samples, lambda rows: float(rows[:, 1].mean()))),
        "mean_gain_worthwhile": _rounded(interval(worthwhile, lambda rows: float(rows.mean())))
        if any(map(len, worthwhile.values()))
        else None,
        "saved": _rounded(interval(samples, lambda rows: float(rows[:, 0].sum() / rows[:, 2].sum()))),
    }


def _rounded(figure: Mapping[str, float]) -> dict[str, float]:
    return {key: round(value, 4) for key, value in figure.items()}


def plot(results: Mapping[str, Any]) -> Figure:
    """The mean gain over the share of cooperative vehicles, and how many orders are feasible.

    Args:
        results: as `maneuver_results` gives them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.1, 3.1), layout="constrained")
    gain, orders = figure.subplots(1, 2)
    _draw_gain(gain, results)
    _draw_orders(orders, results["orders"])
    for axes in (gain, orders):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e4e4e1", linewidth=0.6)
        axes.set_axisbelow(True)
    return figure


def _draw_gain(axes: Axes, results: Mapping[str, Any]) -> None:
    percent = [100.0 * one["share"] for one in results["shares"]]
    value, low, high = ([one["mean_gain"][key] for one in results["shares"]] for key in ("value", "low", "high"))
    label = f"95 % interval over {results['recordings']} recordings"
    axes.fill_between(percent, low, high, color=GAIN_COLOUR, alpha=0.18, linewidth=0.0, label=label)
    axes.plot(percent, value, "o-", color=GAIN_COLOUR, linewidth=1.8, markersize=4.5, label="mean of all moments")
    axes.legend(loc="upper left", fontsize=8, frameon=False)
    axes.set(xlim=(0.0, 102.0), xlabel="vehicles that cooperate [%]", ylabel="time loss saved by the best order [s]")
    axes.set_ylim(0.0, 1.08 * max(*high, WORTHWHILE_GAIN / 10.0))
    axes.set_title(f"Gain in {results['moments']} moments, predicted by {results['policy']}", fontsize=9, loc="left")


def _draw_orders(axes: Axes, orders: Mapping[str, Any]) -> None:
    counts = np.sort(orders["counts"])
    at_least = 100.0 * (1.0 - np.arange(len(counts)) / len(counts))
    axes.step(counts, at_least, where="pre", color=ORDERS_COLOUR, linewidth=1.8)
    for name, text, height in (("median", "median", 50.0), ("p90", "90 % quantile", 10.0)):
        axes.plot(orders[name], height, "o", color=ORDERS_COLOUR, markersize=5.5, markeredgecolor="white", zorder=3.0)
        axes.text(orders[name] * 1.25, height + 1.5, f"{text} {orders[name]:,.0f}", fontsize=8)
    if counts[-1] == orders["counted_to"]:
        axes.axvline(orders["counted_to"], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.text(orders["counted_to"], 100.0, "not counted further ", fontsize=8, color=QUIET, ha="right", va="top")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.set(ylim=(0.0, 103.0), xlabel="feasible orders, all vehicles cooperating")
    axes.set_ylabel("moments with so many or more [%]")
    axes.set_title("Choice of orders", fontsize=9, loc="left")


def table(results: Mapping[str, Any]) -> str:
    """The results as Markdown; intervals in brackets."""
    orders = results["orders"]
    lines = [
        f"{results['moments']} moments of {results['recordings']} recordings, policy {results['policy']}: feasible"
        f" orders {orders['median']:.0f} (median), {orders['p90']:.0f} (90 %), {orders['max']} (most).\n",
        "| cooperative | mean gain [s] | moments with a worthwhile order [%] | mean gain there [s] | loss saved [%] |",
        "|---|---|---|---|---|",
    ]
    for one in results["shares"]:
        cells = [_cell(one["mean_gain"]), _cell(one["worthwhile"], 100.0)]
        cells += [_cell(one["mean_gain_worthwhile"]), _cell(one["saved"], 100.0)]
        lines.append(f"| {100 * one['share']:.0f} % | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(figure: Mapping[str, float] | None, scale: float = 1.0) -> str:
    if figure is None:
        return ""
    value, low, high = (scale * figure[key] for key in ("value", "low", "high"))
    return f"{value:.2f} [{low:.2f}, {high:.2f}]" if scale == 1.0 else f"{value:.1f} [{low:.1f}, {high:.1f}]"


@dataclass(frozen=True)
class Options:
    """Feasible crossing orders and what the best of them saves."""

    scenes: Path = Path("out/scenes.npz")
    """The scenes file; `python -m data.build` makes it."""
    policy: str = "gail"
    """A shipped policy, a rule, or a policy file."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    moments: int = 300
    """How many at most, evenly spread over those with an open conflict."""
    limit: int = LIMIT
    """Orders predicted at most in a moment."""
    seed: int = 0
    """Of who cooperates."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw the results (.png, .svg, .pdf)."""


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    try:
        moments, _ = moments_of(Scenes.load(options.scenes).select(options.split))
        chosen = thinned(contested(moments), options.moments)
        results = maneuver_results(Predictor.load(options.policy), chosen, options.seed, options.limit)
        print(table(results))
        if options.figure:
            write_figure(plot(results), options.figure)
        write_result(options.out / f"maneuvers_{options.split}.json", {"split": options.split, **results})
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
