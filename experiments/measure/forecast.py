"""How well forecasts are calibrated: probabilities of crossing orders, and intervals of where vehicles will be.

python -m experiments.forecast                        on the development recordings
python -m experiments.forecast --split validation     for the report, once
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agents.orders.samples import order_samples
from agents.training.options import Maps
from experiments.measure.order_chances import CLOSEST, Learned, OrderChances, order_chances
from experiments.measure.recorded import places_of
from experiments.results_files import check_outputs, write_result
from experiments.show.crossing_order import POPULATIONS
from experiments.show.forecast import CHANCES, JOINT, SUMO_RULE, forecast_text, plot_reliability
from intersection_env.constants import DT
from intersection_env.evaluation.intervals import interval
from intersection_env.evaluation.moments import HORIZONS, Moment, followed
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.policies.named import DEFAULT
from intersection_env.prediction.forecast import forecast
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import ALL_SCENES
from intersection_env.scenes.scenes import Scenes

LEVELS = np.arange(1, 20) / 20.0
CENTRAL = (1, 17)  # of these, between which lie 80 %
BINS = 10  # of a probability, in a reliability diagram
EVERY = 2.0  # [s] between two moments of which positions are forecast

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """Calibration of forecasts."""

    scenes: tuple[Path, ...] = ALL_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policy: str = DEFAULT
    """A policy that ships, or a policy file."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw the reliability diagram (.png, .svg, .pdf)."""


def forecast_results(predictor: Predictor, scenes: Sequence[Scenes], split: str) -> dict[str, Any]:
    """What forecasts of these scenes come to.

    Args:
        predictor: whose policy holds an order network.
        scenes: those of `split` count; others' models learn from those for training.

    Returns:
        Under "orders", by population ("recorded" at the start both, or "all") the `figures_of` the pairs' orders, with
        those of each place under "places"; under "positions", by horizon [s] and until last seen, of the position:
        `coverage` of the 80 % interval, `crps` [m], and the mean absolute error of the forecast's median and of the
        prediction without orders, with the "count" of samples.

    Raises:
        ValueError: nothing to score; or the policy holds no order network.
    """
    sumo = Predictor(Predictor.load("idm", gap="sumo").policy, SUMO_RULE)
    samples, _ = order_samples(scenes, "train")
    learned = Learned.of(samples, moments_in(scenes, "train")[0], sumo)
    chances = order_chances(predictor, learned, moments_in(scenes, split)[0], sumo)
    orders: dict[str, Any] = {}
    for population in POPULATIONS:
        among = np.ones_like(chances.recorded) if population == "all" else chances.recorded
        orders[population] = figures_of(chances, among)
        places = np.unique(chances.place).tolist()
        orders[population]["places"] = {one: figures_of(chances, among & (chances.place == one)) for one in places}
    moments = followed(moments_in(scenes, split, EVERY)[0])
    return {"policy": predictor.name, "orders": orders, "positions": positions_of(predictor, moments)}


def figures_of(chances: OrderChances, among: NDArray[np.bool_]) -> dict[str, Any]:
    """Scores of the chosen pairs' orders, by model, with intervals over recordings.

    Returns:
        "pairs", and how many are "open" at the start; `accuracy` of all of them by model and by SUMO's rule, and
        `accuracy_minus_sumo` and `accuracy_minus_priority`; of those that are open `open_accuracy`, `log_loss`,
        `brier` and the `calibration_error` (of the more probable order, `BINS` bins); the "reliability" of the joint
        probabilities: by bin, `probability`, `frequency` and `count`.
    """
    truth, still_open = chances.yielder_first, among & chances.is_open

    def over(rows: Floats, chosen: NDArray[np.bool_], statistic: Callable[[Floats], float]) -> dict[str, float] | None:
        if not chosen.any():
            return None
        names = np.unique(chances.recording[chosen]).tolist()
        return interval({name: rows[chosen & (chances.recording == name)] for name in names}, statistic)

    rule = (chances.sumo > 0) == truth
    rule[chances.sumo == 0] = False
    models: dict[str, Any] = {SUMO_RULE: {"accuracy": over(rule.astype(np.float64), among, np.mean)}}
    models[SUMO_RULE]["open_accuracy"] = over(rule.astype(np.float64), still_open, np.mean)
    for name in CHANCES:
        chance = chances.of(name).clip(CLOSEST, 1.0 - CLOSEST)
        right = ((chance > 0.5) == truth).astype(np.float64)
        both = np.stack([np.maximum(chance, 1.0 - chance), right], axis=1)
        models[name] = {
            "accuracy": over(right, among, np.mean),
            "accuracy_minus_sumo": over(right - rule, among, np.mean),
            "accuracy_minus_priority": over(right - ~truth, among, np.mean),
            "open_accuracy": over(right, still_open, np.mean),
            "log_loss": over(-np.log(np.where(truth, chance, 1.0 - chance)), still_open, np.mean),
            "brier": over(np.square(chance - truth), still_open, np.mean),
            "calibration_error": over(both, still_open, calibration_error),
        }
    bins = _reliability(chances.of(JOINT)[still_open], truth[still_open])
    return {"pairs": int(among.sum()), "open": int(still_open.sum()), "models": models, "reliability": bins}


def calibration_error(samples: Floats) -> float:
    """Mean distance between confidence and frequency; samples: (pair, 2), confidence from 0.5 to 1 and right or not."""
    confidence, right = samples.T
    place = np.minimum(((confidence - 0.5) * 2 * BINS).astype(np.int64), BINS - 1)
    gaps = np.bincount(place, confidence - right, minlength=BINS)
    return float(np.abs(gaps).sum() / len(samples))


def _reliability(chance: Floats, truth: NDArray[np.bool_]) -> list[dict[str, float]]:
    place = np.minimum((chance * BINS).astype(np.int64), BINS - 1)
    rows = [(chance[place == k], truth[place == k]) for k in range(BINS)]
    return [
        {"probability": float(of.mean()), "frequency": float(first.mean()), "count": len(of)}
        for of, first in rows
        if len(of)
    ]


def positions_of(predictor: Predictor, moments: Sequence[Moment]) -> dict[str, Any]:
    """Scores of the quantiles of position, at the horizons and until last seen.

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to score a forecast in")
    rows: dict[str, list[tuple[str, Floats]]] = {key: [] for key in (*map("{:g}".format, HORIZONS), "until_last_seen")}
    for moment in moments:
        quantiles = forecast(predictor, moment.traffic).position_quantiles(LEVELS)
        plain = predictor.predict(moment.traffic).position[0]
        last = moment.last_seen()
        of_last = np.flatnonzero(~np.ma.getmaskarray(last))
        chosen = {"until_last_seen": (last.data[of_last], of_last)}
        for horizon in HORIZONS:
            then = round(horizon / DT)
            vehicle = np.flatnonzero(moment.scored[0] & moment.scored[then])
            chosen[f"{horizon:g}"] = (np.full(len(vehicle), then), vehicle)
        for key, (step, vehicle) in chosen.items():
            truth = moment.recorded.data[step, vehicle].astype(np.float64)
            found = _scores(quantiles[:, step, vehicle].astype(np.float64), plain[step, vehicle], truth)
            rows[key].append((moment.scene.recording, found))
    return {key: _of_positions(parts) for key, parts in rows.items()}


def _scores(quantiles: Floats, plain: NDArray[np.float32], truth: Floats) -> Floats:
    """(sample, 4): within the central interval, CRPS, absolute errors of the median and of the plain prediction."""
    low, high = (quantiles[k] for k in CENTRAL)
    distance = truth - quantiles
    pinball = np.maximum(LEVELS[:, None] * distance, (LEVELS[:, None] - 1.0) * distance)
    median = np.abs(distance[len(LEVELS) // 2])
    return np.stack(
        [(low <= truth) & (truth <= high), 2.0 * pinball.mean(axis=0), median, np.abs(plain - truth)], axis=1
    )


def _of_positions(parts: Sequence[tuple[str, Floats]]) -> dict[str, Any]:
    recordings = sorted({name for name, _ in parts})
    samples = {one: np.concatenate([rows for name, rows in parts if name == one]) for one in recordings}
    keys = ("coverage", "crps", "median_error", "error_without_orders")
    found: dict[str, Any] = {"count": sum(map(len, samples.values()))}
    if not found["count"]:
        return found | dict.fromkeys(keys)
    for k, key in enumerate(keys):
        found[key] = interval({one: rows[:, k] for one, rows in samples.items()}, np.mean)
    return found


def main(options: Options) -> int:
    """Measures as told, prints the tables, writes the results; returns the exit status."""
    out = options.out / f"forecast_{options.split}.json"
    try:
        check_outputs(out, options.figure)
        places, predictor = places_of(options.scenes, options.map, options.split), Predictor.load(options.policy)
        if not predictor.core_policy.can_forecast:
            raise ValueError(f'the policy "{predictor.name}" holds no order network')
        results: Mapping[str, Any] = forecast_results(predictor, places, options.split)
        print(forecast_text(results))
        if options.figure:
            write_figure(plot_reliability(results), options.figure)
        write_result(out, {"split": options.split, **results})
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
