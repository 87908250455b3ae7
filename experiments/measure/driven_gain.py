"""Do maneuvers help? SUMO drives on from recorded moments, with the best maneuver's order imposed and without.

python -m experiments.driven_gain --figure out/driven.svg    on the development recordings
python -m experiments.driven_gain --split validation         for the report, once

The drivers are those of the simulated recordings, the same with and without, and all take instructions
(`experiments.models.driven_on`).
The maneuver is the best safe one of `rank_maneuvers`, by expectation and by prediction; who plans it knows nothing of
the drivers but where they are and how fast. Where all vehicles cooperate, an order leaves nothing open, so that both
rankings choose the same one; what they expect of no intervention differs, and with it which gains exceed 2 s.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from experiments.measure.driven_plans import Order, Plan, jobs_of, plan_of
from experiments.measure.driven_scores import REAL, Samples, differences, noise_figures, ranking_figures
from experiments.measure.recorded import places_of
from experiments.models.driven_on import Driven, driven_on
from experiments.models.from_trajectories import lost_time, minimum_distance, prediction_of_trajectories
from experiments.results_files import check_outputs, write_result
from experiments.show.driven_gain import driven_text, plot_driven
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.moments import Moment, contested, thinned
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.policies.named import DEFAULT
from intersection_env.prediction.maneuvers import RANKED_BY
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic

LEAST_DISTANCE = 0.5  # [m], below which an order is unsafe
HARD = 4.0  # [m/s²], paper, Eq. (3): full braking
MOMENTS = 600  # at most


class Run(NamedTuple):
    """One run, measured.

    loss, later: of all vehicles in 10 and in 20 s [s]. crossed: (pair,) who came first. distance: the smallest between
    bodies [m]; braking: the hardest [m/s²]; both within 20 s. unheld: somebody should have waited and could not.
    """

    loss: float
    later: float
    crossed: Order
    distance: float
    braking: float
    unheld: bool

    @property
    def flags(self) -> list[float]:
        """HIT, NEAR, HARD."""
        return [float(self.distance <= 0.0), float(self.distance < LEAST_DISTANCE), float(self.braking > HARD)]


def measured(traffic: Traffic, driven: Driven) -> Run:
    """One run's losses, order, distance and braking."""
    near = prediction_of_trajectories(traffic, *driven.motions.within(STEPS))
    return Run(
        float(near.time_loss.sum(dtype=np.float64)),
        float(lost_time(traffic, *driven.motions).sum(dtype=np.float64)),
        crossing_order(traffic, near)[0],
        minimum_distance(traffic, *driven.motions),
        float(-np.diff(driven.motions.speed, axis=0).min() / DT),
        bool(driven.unheld),
    )


def rows_of_plan(plan: Plan, runs: Sequence[Run], again: Run) -> dict[str, list[float]]:
    """The columns of `driven_scores.Column` by ranking, of those with a safe maneuver.

    Args:
        plan: what was planned.
        runs: without, then under each of the plan's orders.
        again: without, by another seed.
    """
    without, *others = runs
    under = {order.tobytes(): run for order, run in zip(plan.orders, others, strict=True)}
    gains = [without.loss - run.loss for run in others if run.distance > 0.0]
    found = {}
    for by, best in plan.best.items():
        if best is None:
            continue
        run = under[best.order.tobytes()]
        found[by] = [
            *(best.gain, without.loss - run.loss, without.later - run.later),
            float(not run.unheld and not (run.crossed * best.order < 0).any()),
            float(not (without.crossed * best.order < 0).any()),
            *(*run.flags, *without.flags, without.loss, without.loss - again.loss),
            max([0.0, *gains]) if plan.all_driven else np.nan,
            best.chance,
        ]
    return found


def driven_results(predictor: Predictor, moments: Sequence[Moment], seed: int) -> dict[str, Any]:
    """What the best maneuvers save as SUMO drives them, beside what was predicted.

    Args:
        predictor: who plans.
        moments: each with an open conflict, as `contested` gives them.
        seed: of the drivers and of SUMO.

    Returns:
        `missing`: empty, as something was driven. `rankings`: by name `ranking_figures` and `without_maneuver` (moments
        without a safe one, left away). `expectation_minus_prediction`: as of `differences`, over moments in which both
        have a maneuver. `noise`: as of `noise_figures`. `bars`: what is wanted of these figures, and whether it is so.
        `points`: by ranking (moment, [predicted, realised]).

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        ValueError: no moments, or a policy without an order network.
    """
    if not moments:
        raise ValueError("no moments with an open conflict to drive on from")
    plans = [plan_of(predictor, moment) for moment in moments]
    jobs = [job for number, plan in enumerate(plans) for job in jobs_of(plan, number, seed)]
    runs = [[measured(job.traffic, one) for one in of_job] for job, of_job in zip(jobs, driven_on(jobs), strict=True)]
    found = [rows_of_plan(*one) for one in zip(plans, runs[::2], [again[0] for again in runs[1::2]], strict=True)]
    by_ranking = {by: _samples(moments, found, by, (by,)) for by in RANKED_BY}
    rankings = {by: ranking_figures(samples) for by, samples in by_ranking.items()}
    for by, figures in rankings.items():
        figures["without_maneuver"] = sum(by not in one for one in found)
    gap = differences(*(_samples(moments, found, by, RANKED_BY) for by in RANKED_BY))
    return {
        "missing": {},
        "policy": predictor.name,
        "seed": seed,
        "moments": len(moments),
        "recordings": len({moment.scene.recording for moment in moments}),
        "rankings": rankings,
        "expectation_minus_prediction": gap,
        "noise": noise_figures(by_ranking[RANKED_BY[0]]),
        "bars": _bars(rankings, gap),
        "points": {by: [one[by][:2] for one in found if by in one] for by in RANKED_BY},
    }


def _samples(
    moments: Sequence[Moment], found: Sequence[Mapping[str, list[float]]], by: str, needed: Sequence[str]
) -> Samples:
    """One ranking's rows by recording, of the moments in which all that are needed have a maneuver."""
    rows: dict[str, list[list[float]]] = {}
    for moment, one in zip(moments, found, strict=True):
        if all(name in one for name in needed):
            rows.setdefault(moment.scene.recording, []).append(one[by])
    return {name: np.array(rows[name]) for name in sorted(rows)}


def _bars(rankings: Mapping[str, Any], gap: Mapping[str, Mapping[str, float]]) -> dict[str, bool]:
    promised = {by: figures["all"]["promised"] for by, figures in rankings.items()}
    real = {f"real_{by}": one is not None and one["real"]["value"] >= REAL for by, one in promised.items()}
    return {**real, "expectation_not_below_prediction": all(one["value"] >= 0.0 for one in gap.values())}


@dataclass(frozen=True)
class Options:
    """What the best maneuvers save, as SUMO drives them."""

    scenes: Path = Path("bendplatz")
    """Scenes on Bendplatz: those that ship (their name), or a scenes file; SUMO has no other network here."""
    policy: str = DEFAULT
    """A policy that ships, or a policy file with an order network."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    moments: int = MOMENTS
    """How many at most, evenly spread over those with an open conflict."""
    seed: int = 0
    """Of the drivers and of SUMO."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw realised over predicted gains (.png, .svg, .pdf)."""


def main(options: Options) -> int:
    """Measures as told, prints the tables, writes the results; returns the exit status."""
    out = options.out / f"driven_gain_{options.split}.json"
    try:
        check_outputs(out, options.figure)
        moments, _ = moments_in(places_of((options.scenes,), (), options.split), options.split)
        chosen = thinned(contested(moments), options.moments)
        results = driven_results(Predictor.load(options.policy), chosen, options.seed)
        print(driven_text(results))
        if options.figure:
            write_figure(plot_driven(results), options.figure)
        write_result(out, {"split": options.split, "missing": {}, **results})
    except (OSError, ValueError, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
