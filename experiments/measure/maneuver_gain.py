"""How many crossing orders are feasible, and how much time the best of them saves, by how many vehicles cooperate.

python -m experiments.maneuver_gain --figure out/maneuvers.svg    on the development recordings
python -m experiments.maneuver_gain --split validation            for the report, once

Gains are predicted, not driven: of the best safe order against no intervention, over 10 s.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.training.options import Maps
from experiments.measure.recorded import places_of
from experiments.results_files import check_outputs, write_result
from experiments.show.maneuver_gain import gain_table, plot_gain
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import Moment, contested, thinned
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.policies.named import DEFAULT
from intersection_env.prediction.maneuvers import COUNT_LIMIT, LIMIT, rank_maneuvers
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES
from intersection_env.traffic import Traffic

SHARES = tuple(tenth / 10 for tenth in range(1, 11))  # of the vehicles that take instructions

Floats = NDArray[np.float64]


class Column(IntEnum):
    """Of the rows that are resampled, one a moment."""

    GAIN = 0
    WORTHWHILE = 1
    TIME_LOSS = 2


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
    orders = np.array([of_shares[-1].orders for of_shares in found])
    recording = np.array([moment.scene.recording for moment in moments])
    rows = np.array([[(one.gain, one.worthwhile, one.time_loss) for one in of_shares] for of_shares in found])
    names = sorted(set(recording.tolist()))
    shares = []
    for k, share in enumerate(SHARES):
        shares.append({"share": share, **_figures({name: rows[recording == name, k] for name in names})})
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


def _figures(samples: Mapping[str, Floats]) -> dict[str, Any]:
    """Of the rows (moment, `Column`) by recording."""
    worthwhile = {name: rows[rows[:, Column.WORTHWHILE] > 0.0, Column.GAIN] for name, rows in samples.items()}
    there = any(map(len, worthwhile.values()))
    return {
        "mean_gain": _rounded(interval(samples, lambda rows: float(rows[:, Column.GAIN].mean()))),
        "worthwhile": _rounded(interval(samples, lambda rows: float(rows[:, Column.WORTHWHILE].mean()))),
        "mean_gain_worthwhile": _rounded(interval(worthwhile, lambda gains: float(gains.mean()))) if there else None,
        "saved": _rounded(interval(samples, _saved)),
    }


def _saved(rows: Floats) -> float:
    return float(rows[:, Column.GAIN].sum() / rows[:, Column.TIME_LOSS].sum())


def _rounded(figure: Mapping[str, float]) -> dict[str, float]:
    return {key: round(value, 4) for key, value in figure.items()}


@dataclass(frozen=True)
class Options:
    """Feasible crossing orders and what the best of them saves."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policy: str = DEFAULT
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
    out = options.out / f"maneuvers_{options.split}.json"
    try:
        check_outputs(out, options.figure)
        moments, _ = moments_in(places_of(options.scenes, options.map, options.split), options.split)
        chosen = thinned(contested(moments), options.moments)
        results = maneuver_results(Predictor.load(options.policy), chosen, options.seed, options.limit)
        print(gain_table(results))
        if options.figure:
            write_figure(plot_gain(results), options.figure)
        write_result(out, {"split": options.split, **results})
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
