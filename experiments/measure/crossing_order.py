"""How often conflicting vehicles are predicted to cross in the order in which they were recorded to.

python -m experiments.crossing_order                     on the development recordings: what choices are made by
python -m experiments.crossing_order --split validation  for the report, once

No priorities are assigned, and all vehicles of a moment are predicted jointly; paper, "Gap Acceptance Accuracy".
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agents.training.options import Maps
from experiments.measure.recorded import places_of
from experiments.models.patient import patient
from experiments.results_files import check_outputs, write_result
from experiments.show.crossing_order import (
    BASELINES,
    COMPARED,
    CRITICAL_GAP,
    POPULATIONS,
    PRIORITY_FIRST,
    SUMO_RULE,
    order_table,
)
from intersection_env.constants import DT
from intersection_env.evaluation.errors import Forecaster
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import HORIZONS, Moment
from intersection_env.evaluation.places import moments_in
from intersection_env.evaluation.recorded_order import scored_order
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Pairs:
    """The scored pairs of some moments.

    recording: (pair,) its id. order: (pair,) +1 the yielder came first, -1 the prioritized vehicle. steps: (pair,)
    from the start until the first of the two reached the conflict, 0 where one of them already had. recorded: (pair,)
    whether both are recorded at the start. predicted: by model, (pair,) as `order`, and 0 where unresolved.
    """

    recording: NDArray[np.str_]
    order: NDArray[np.int8]
    steps: NDArray[np.int64]
    recorded: Flags
    predicted: Mapping[str, NDArray[np.int8]]

    def right(self, model: str, chosen: Flags) -> dict[str, NDArray[np.float64]]:
        """Of the chosen pairs, 1 where a model is right and 0 where it is not: (pair,) by recording."""
        right = (self.predicted[model] == self.order).astype(np.float64)
        return {name: right[chosen & (self.recording == name)] for name in np.unique(self.recording).tolist()}


def scored_pairs(predictors: Sequence[Forecaster], moments: Sequence[Moment]) -> Pairs:
    """The pairs of cars and trucks whose recorded order is known within the horizon; bicycles only take part.

    Raises:
        ValueError: two predictors have one name, or that of a baseline; or there is no such pair.
    """
    rules: list[Forecaster] = [
        Predictor(Predictor.load("idm", gap="sumo").policy, SUMO_RULE),
        Predictor(Predictor.load("idm").policy, CRITICAL_GAP),
    ]
    names = [one.name for one in predictors] + list(BASELINES)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f'"{twice[0]}" names two models; each needs a name of its own, and {BASELINES} are taken')
    parts = [one for moment in moments if (one := _pairs_of([*predictors, *rules], moment)) is not None]
    if not parts:
        raise ValueError(f"no pair of vehicles of known order in {len(moments)} moments")
    columns = ("recording", "order", "steps", "recorded")
    joined = {column: np.concatenate([getattr(part, column) for part in parts]) for column in columns}
    predicted = {name: np.concatenate([part.predicted[name] for part in parts]) for name in names}
    return Pairs(**joined, predicted=predicted)


def _pairs_of(predictors: Sequence[Forecaster], moment: Moment) -> Pairs | None:
    traffic, tracks = moment.traffic, moment.tracks()
    observed = np.array([track.observed[moment.step - track.start] for track in tracks], np.bool_)
    order, steps = scored_order(moment)
    scored = order != 0
    if not scored.any():
        return None
    predicted = {one.name: crossing_order(traffic, one.predict(traffic))[0, scored] for one in predictors}
    return Pairs(
        recording=np.full(scored.sum(), moment.scene.recording),
        order=order[scored],
        steps=steps[scored],
        recorded=observed[traffic.conflicts[scored]].all(axis=1),
        predicted={**predicted, PRIORITY_FIRST: np.full(scored.sum(), -1, np.int8)},
    )


def order_results(predictors: Sequence[Forecaster], moments: Sequence[Moment]) -> dict[str, Any]:
    """How often predicted crossing orders are the recorded ones, with intervals over recordings.

    Args:
        predictors: beside the baselines, which are always measured: who has priority goes first; the IDM with SUMO's
            rule; the IDM with critical gaps.
        moments: as `moments_of` gives them.

    Returns:
        By population, `pairs`, of which `settled` (one vehicle has reached the conflict at the start, so that all are
        right); and by model `accuracy`, `open_accuracy` (of pairs not settled), `unresolved` (share of the pairs;
        they count as wrong) and `minus` (accuracy minus that of others, pair by pair); and of the pairs not settled,
        `by_first` (who came first in the recording) and `by_time` (when: `after` to `until` [s]).

    Raises:
        ValueError: as in `scored_pairs`.
    """
    pairs = scored_pairs(predictors, moments)
    results: dict[str, Any] = {"moments": len(moments), "recordings": len(np.unique(pairs.recording))}
    for population in POPULATIONS:
        chosen = np.ones_like(pairs.recorded) if population == "all" else pairs.recorded
        sizes = {"pairs": int(chosen.sum()), "settled": int((chosen & (pairs.steps == 0)).sum())}
        models = {name: _figures(pairs, name, chosen) for name in pairs.predicted}
        results[population] = {**sizes, "models": models}
    return results


def _figures(pairs: Pairs, model: str, chosen: Flags) -> dict[str, Any]:
    right, still_open = pairs.right(model, chosen), chosen & (pairs.steps > 0)
    others = {other: pairs.right(other, chosen) for other in COMPARED if other != model}
    bins = np.digitize(pairs.steps, [round(horizon / DT) for horizon in HORIZONS], right=True)

    def part(flags: Flags) -> dict[str, Any]:
        within = still_open & flags
        return {"pairs": int(within.sum()), "accuracy": _mean(pairs.right(model, within))}

    return {
        "accuracy": _mean(right),
        "open_accuracy": _mean(pairs.right(model, still_open)),
        "unresolved": round(float((pairs.predicted[model][chosen] == 0).mean()), 4) if chosen.any() else None,
        "minus": {other: _mean({key: right[key] - theirs[key] for key in right}) for other, theirs in others.items()},
        "by_first": {first: part(pairs.order == way) for first, way in (("yielder", 1), ("prioritized", -1))},
        "by_time": [
            {"after": after, "until": until, **part(bins == k)}
            for k, (after, until) in enumerate(itertools.pairwise((0.0, *HORIZONS)))
        ],
    }


def _mean(samples: Mapping[str, NDArray[np.float64]]) -> dict[str, float] | None:
    """With its interval; None of nothing."""
    if not any(len(part) for part in samples.values()):
        return None
    return {key: round(value, 4) for key, value in interval(samples, lambda all_: float(all_.mean())).items()}


@dataclass(frozen=True)
class Options:
    """Accuracy of the predicted crossing order."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    policies: tuple[str, ...] = ("rollout_gradient", "gail", "ppo", "gap", "idm_calibrated", "constant_velocity")
    """Names of shipped policies or rules, or policy files."""
    patient: tuple[str, ...] = ("rollout_gradient",)
    """Likewise, those that predict once more, with patience kept."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""


def main(options: Options) -> int:
    """Measures as told, prints the tables, writes the results; returns the exit status."""
    out = options.out / f"order_{options.split}.json"
    try:
        check_outputs(out)
        moments, refused = moments_in(places_of(options.scenes, options.map, options.split), options.split)
        models = [Predictor.load(policy) for policy in options.policies]
        results = order_results([*models, *(patient(Predictor.load(one)) for one in options.patient)], moments)
        content = {"split": options.split, "refused": len(refused), **results}
        print(order_table(results))
        write_result(out, content)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
