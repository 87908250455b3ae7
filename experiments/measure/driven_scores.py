"""What maneuvers that were driven were worth: gains as predicted and as realised, the rule, regret, collisions."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.evaluation.intervals import interval
from intersection_env.prediction.maneuvers import WORTHWHILE_GAIN

LIKELY = 0.8  # ours, chosen on development: from this chance on a gain is likely
REAL = 0.8  # of the gains above 2 s; ours

Floats = NDArray[np.float64]
Samples = Mapping[str, Floats]
"""By recording, (moment, `Column`)."""


class Column(IntEnum):
    """Of a moment and a ranking; gains and losses in s, flags 0 or 1.

    PREDICTED: gain of the best safe maneuver. REALISED, LATER: loss without it minus loss with it, in 10 and in 20 s.
    KEPT: nobody crossed against the order, and all who were told to wait could. ALREADY: without it nobody crossed
    against it either. HIT, NEAR, HARD: within 20 s bodies overlapped, came nearer than 0.5 m, somebody braked harder
    than 4 m/s²; each also WITHOUT. LOSS: without it, in 10 s. NOISE: that loss minus the one under another seed of
    SUMO. BEST: realised gain of the best of all orders without a collision, or of no intervention; NaN where not
    all were driven. CHANCE: that the gain exceeds 2 s, as predicted; NaN where the ranking gives none.
    """

    PREDICTED = 0
    REALISED = 1
    LATER = 2
    KEPT = 3
    ALREADY = 4
    HIT = 5
    NEAR = 6
    HARD = 7
    HIT_WITHOUT = 8
    NEAR_WITHOUT = 9
    HARD_WITHOUT = 10
    LOSS = 11
    NOISE = 12
    BEST = 13
    CHANCE = 14


MEANS = ("PREDICTED", "REALISED", "LATER", "HIT", "NEAR", "HARD", "HIT_WITHOUT", "NEAR_WITHOUT", "HARD_WITHOUT")


def ranking_figures(samples: Samples) -> dict[str, Any]:
    """Of the best maneuvers by one ranking: of all moments, of those with the order kept and of the others.

    Returns:
        Of each population `figures_of`; `kept`, `already` (shares with intervals).
    """
    kept = {name: rows[:, Column.KEPT] > 0.0 for name, rows in samples.items()}
    return {
        "kept": _rounded(interval(samples, partial(_mean, Column.KEPT))),
        "already": _rounded(interval(samples, partial(_mean, Column.ALREADY))),
        "all": figures_of(samples),
        "order_kept": figures_of({name: rows[kept[name]] for name, rows in samples.items()}),
        "order_not_kept": figures_of({name: rows[~kept[name]] for name, rows in samples.items()}),
        "already_so": figures_of({name: rows[rows[:, Column.ALREADY] > 0.0] for name, rows in samples.items()}),
    }


def figures_of(samples: Samples) -> dict[str, Any] | None:
    """Gains, the rule, regret and collisions of some moments; None of none.

    Returns:
        `moments`; with intervals over recordings the means of `MEANS`, `correlation`, `by_rule` (realised gain a moment
        of who executes what promises more than 2 s), `regret` and `regret_always` (of that, and of always executing,
        against the better of executing and not), `saved` (realised gain as a share of the loss without); `promised`, as
        of `_promised` those with a predicted gain above 2 s, `likely` those of them with a chance of at least 80 % that
        it exceeds 2 s; `searched`: as of `_searched`.
    """
    if not any(map(len, samples.values())):
        return None
    figures = {name.lower(): interval(samples, partial(_mean, Column[name])) for name in MEANS}
    figures["correlation"] = interval(samples, _correlation)
    figures["by_rule"] = interval(samples, lambda rows: float(_by_rule(rows).mean()))
    figures["regret"] = interval(samples, lambda rows: float((_better(rows) - _by_rule(rows)).mean()))
    figures["regret_always"] = interval(samples, lambda rows: float((_better(rows) - rows[:, Column.REALISED]).mean()))
    figures["saved"] = interval(
        samples, lambda rows: float(rows[:, Column.REALISED].sum() / rows[:, Column.LOSS].sum())
    )
    promised = {name: rows[rows[:, Column.PREDICTED] > WORTHWHILE_GAIN] for name, rows in samples.items()}
    likely = {name: rows[rows[:, Column.CHANCE] >= LIKELY] for name, rows in promised.items()}
    rest = {"promised": _promised(promised), "likely": _promised(likely), "searched": _searched(samples)}
    return {"moments": sum(map(len, samples.values())), **{key: _rounded(one) for key, one in figures.items()}, **rest}


def _promised(there: Samples) -> dict[str, Any] | None:
    """Whether what was promised came, None of no moments.

    Returns:
        `moments`; shares `real` (the realised gain is positive), `real_worthwhile` (it is above 2 s) and `real_later`
        (positive in 20 s); means `predicted`, `realised` and `later` [s].
    """
    if not any(map(len, there.values())):
        return None
    figures = {
        "real": interval(there, lambda rows: float((rows[:, Column.REALISED] > 0.0).mean())),
        "real_worthwhile": interval(there, lambda rows: float((rows[:, Column.REALISED] > WORTHWHILE_GAIN).mean())),
        "real_later": interval(there, lambda rows: float((rows[:, Column.LATER] > 0.0).mean())),
        "predicted": interval(there, partial(_mean, Column.PREDICTED)),
        "realised": interval(there, partial(_mean, Column.REALISED)),
        "later": interval(there, partial(_mean, Column.LATER)),
    }
    return {"moments": sum(map(len, there.values())), **{key: _rounded(one) for key, one in figures.items()}}


def _searched(samples: Samples) -> dict[str, Any] | None:
    """Of the moments of which all orders were driven, None without any.

    Returns:
        `moments`; means `best` (realised gain of the best), `regret` and `regret_always` against it [s].
    """
    there = {name: rows[~np.isnan(rows[:, Column.BEST])] for name, rows in samples.items()}
    if not any(map(len, there.values())):
        return None
    figures = {
        "best": interval(there, partial(_mean, Column.BEST)),
        "regret": interval(there, lambda rows: float((rows[:, Column.BEST] - _by_rule(rows)).mean())),
        "regret_always": interval(there, lambda rows: float((rows[:, Column.BEST] - rows[:, Column.REALISED]).mean())),
    }
    return {"moments": sum(map(len, there.values())), **{key: _rounded(one) for key, one in figures.items()}}


def noise_figures(samples: Samples) -> dict[str, float]:
    """What another seed of SUMO alone changes in the loss of all vehicles [s]: `median`, `p90` of its size."""
    size = np.abs(np.concatenate([rows[:, Column.NOISE] for rows in samples.values()]))
    median, p90 = np.quantile(size, [0.5, 0.9]).tolist()
    return {"median": median, "p90": p90}


def differences(one: Samples, other: Samples) -> dict[str, dict[str, float]]:
    """By how much the first ranking's mean realised gain exceeds the other's, moment by moment [s].

    Returns:
        `always`: every best maneuver executed; `by_rule`: those that promise more than 2 s.
    """
    always = {name: one[name][:, Column.REALISED] - other[name][:, Column.REALISED] for name in one}
    by_rule = {name: _by_rule(one[name]) - _by_rule(other[name]) for name in one}
    return {
        name: _rounded(interval(paired, lambda gains: float(gains.mean())))
        for name, paired in (("always", always), ("by_rule", by_rule))
    }


def _mean(column: Column, rows: Floats) -> float:
    return float(rows[:, column].mean())


def _by_rule(rows: Floats) -> Floats:
    return np.where(rows[:, Column.PREDICTED] > WORTHWHILE_GAIN, rows[:, Column.REALISED], 0.0)


def _better(rows: Floats) -> Floats:
    return np.maximum(0.0, rows[:, Column.REALISED])


def _correlation(rows: Floats) -> float:
    """0 where one of both is the same everywhere."""
    predicted, realised = rows[:, Column.PREDICTED], rows[:, Column.REALISED]
    if np.ptp(predicted) == 0.0 or np.ptp(realised) == 0.0:
        return 0.0
    return float(np.corrcoef(predicted, realised)[0, 1])


def _rounded(figure: Mapping[str, float]) -> dict[str, float]:
    return {key: round(value, 4) for key, value in figure.items()}
