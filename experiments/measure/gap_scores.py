"""How often gap decisions are right, and how well calibrated: counts, and intervals over recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from agents.gap.baselines import Decider, Floats
from agents.gap.samples import UNKNOWN, Foes, GapSamples, Kinematics
from experiments.show.gap import BINS, MEASURES, NETWORK
from intersection_env.evaluation.intervals import COVERAGE, RESAMPLES, SEED

FOES: tuple[Foes, ...] = get_args(Foes)


@dataclass(frozen=True)
class Tally:
    """What a decider got right, by recording.

    samples, positives, right, right_positives: (recording,) samples, those that went first, decided rightly.
    before, right_before: (recording,) samples before the stop line, and those decided rightly.
    pairs, right_pairs: (recording,) pairs of known order; right_pairs is None where pairs are not decided.
    bins: (recording, bin, 3) samples, sum of probabilities and positives; None without probabilities.
    """

    samples: Floats
    positives: Floats
    right: Floats
    right_positives: Floats
    before: Floats
    right_before: Floats
    pairs: Floats
    right_pairs: Floats | None
    bins: Floats | None


def tally(decider: Decider, samples: GapSamples, recordings: Sequence[str]) -> Tally:
    """The counts of a decider on samples, one row a recording (sorted)."""
    of = np.searchsorted(np.array(recordings), samples.sample_recording)
    of_pair, known = of[samples.sample], samples.first != UNKNOWN
    label = samples.labels()
    right = decider.decide(samples) == label
    before = np.zeros(len(samples), np.bool_)  # the same in all pairs of a sample
    before[samples.sample] = samples.kinematics[:, Kinematics.DISTANCE_TO_STOP_LINE] >= 0.0
    accepts, probability = decider.accepts(samples), decider.probability(samples)

    def count(places: NDArray[np.int64], flags: NDArray[np.bool_]) -> Floats:
        return np.bincount(places[flags], minlength=len(recordings)).astype(np.float64)

    return Tally(
        samples=count(of, np.ones_like(label)),
        positives=count(of, label),
        right=count(of, right),
        right_positives=count(of, right & label),
        before=count(of, before),
        right_before=count(of, right & before),
        pairs=count(of_pair, known),
        right_pairs=None if accepts is None else count(of_pair, known & (accepts == (samples.first == 1))),
        bins=None if probability is None else _bins(probability, label, of, len(recordings)),
    )


def _bins(probability: Floats, label: NDArray[np.bool_], of: NDArray[np.int64], recordings: int) -> Floats:
    bins = np.zeros((recordings, BINS, 3))
    place = np.minimum((probability * BINS).astype(np.int64), BINS - 1)
    np.add.at(bins, (of, place), np.stack([np.ones(len(label)), probability, label], axis=1))
    return bins


def measures(counted: Tally, weight: Floats) -> dict[str, Floats]:
    """Base rate and `MEASURES` under weights of the recordings (resample, recording): (resample,) each.

    NaN where a resample has nothing to measure; measures that the decider cannot have are left out.
    """

    def share(part: Floats, whole: Floats) -> Floats:
        with np.errstate(invalid="ignore"):
            result: Floats = (weight @ part) / (weight @ whole)
        return result

    negatives = counted.samples - counted.positives
    right_negatives = counted.right - counted.right_positives
    sensitivity, specificity = share(counted.right_positives, counted.positives), share(right_negatives, negatives)
    result = {
        "base_rate": share(negatives, counted.samples),
        "accuracy": share(counted.right, counted.samples),
        "balanced_accuracy": 0.5 * (sensitivity + specificity),
        "accuracy_before_stop_line": share(counted.right_before, counted.before),
    }
    if counted.right_pairs is not None:
        result["pair_accuracy"] = share(counted.right_pairs, counted.pairs)
    if counted.bins is not None:
        count, predicted, positives = np.moveaxis(np.tensordot(weight, counted.bins, axes=1), -1, 0)
        result["calibration_error"] = np.abs(predicted - positives).sum(axis=1) / count.sum(axis=1)
    return result


def compare(tallies: Mapping[str, Tally]) -> dict[str, Any]:
    """Values with bootstrap intervals over recordings of all deciders, and of the network minus each.

    Every resample of the recordings serves all deciders, so the differences are paired.
    """
    network = tallies[NETWORK]
    count = len(network.samples)
    drawn = np.random.default_rng(SEED).multinomial(count, np.full(count, 1.0 / count), RESAMPLES)
    weight = np.concatenate([np.ones((1, count)), drawn])  # the first row is the recordings as they are
    by_name = {name: measures(one, weight) for name, one in tallies.items()}
    models: dict[str, Any] = {}
    for name, values in by_name.items():
        models[name] = {key: _interval(values[key]) if key in values else None for key in MEASURES}
        both = [key for key in MEASURES if key in values and name != NETWORK]
        models[name]["network_minus"] = {key: _interval(by_name[NETWORK][key] - values[key]) for key in both}
        models[name]["reliability"] = _reliability(tallies[name])
    base_rate = _interval(by_name[NETWORK]["base_rate"])
    sizes = {"samples": int(network.samples.sum()), "pairs": int(network.pairs.sum())}
    return {"recordings": count, **sizes, "base_rate": base_rate, "models": models}


def _interval(values: Floats) -> dict[str, float] | None:
    """The value itself, first, and the interval of the resamples behind it; undefined resamples are left out.

    None where the value itself is undefined, as there is nothing to measure.
    """
    if np.isnan(values[0]):
        return None
    low, high = np.nanquantile(values[1:], (0.5 - 0.5 * COVERAGE, 0.5 + 0.5 * COVERAGE))
    return {"value": round(float(values[0]), 4), "low": round(float(low), 4), "high": round(float(high), 4)}


def _reliability(counted: Tally) -> list[dict[str, float]] | None:
    """Mean probability and share of positives of each bin that has samples."""
    if counted.bins is None:
        return None
    rows = counted.bins.sum(axis=0).tolist()
    return [{"samples": int(n), "predicted": round(p / n, 4), "observed": round(y / n, 4)} for n, p, y in rows if n]


def pooled(folds: Sequence[Mapping[str, Tally]]) -> dict[str, Any]:
    """Every recording counts once, where it was held out; beside it the accuracies fold by fold, and their mean."""
    result = compare({name: _joined([fold[name] for fold in folds]) for name in folds[0]})
    for name, model in result["models"].items():
        each = [float(fold[name].right.sum() / fold[name].samples.sum()) for fold in folds]
        model["fold_accuracies"] = [round(one, 4) for one in each]
        model["fold_mean"] = round(float(np.mean(each)), 4)
    return result


def _joined(parts: Sequence[Tally]) -> Tally:
    columns: dict[str, Any] = {}
    for field in fields(Tally):
        values = [getattr(part, field.name) for part in parts]
        columns[field.name] = None if values[0] is None else np.concatenate(values)
    return Tally(**columns)
