"""Which maneuver is chosen of a traffic that errs, and what that choice is worth in the traffic as it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.show.perception import AWARE, UNAWARE
from intersection_env.prediction.forecast import TRIES, forecast
from intersection_env.prediction.maneuvers import rank_maneuvers
from intersection_env.prediction.noise import Noise, drawn, still_open
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic

LIMIT = 1000  # orders that are ranked
CANDIDATES = 5  # maneuvers among which who knows of the errors chooses
LEAST_DISTANCE = 0.5  # [m], below which an order is unsafe

Priorities = tuple[tuple[str, str], ...]


class Choice(NamedTuple):
    """A maneuver chosen of what was seen, in the traffic as it is.

    same: the best one there, too. refused: it cannot be carried out there, so that nothing is imposed. unsafe: it is
    carried out, and bodies come nearer than 0.5 m. regret: expected gain of the best safe one there minus its own [s],
    below 0 where an unsafe one gains more.
    """

    same: bool
    refused: bool
    unsafe: bool
    regret: float


def choices_of(predictor: Predictor, traffic: Traffic, seen: Traffic, noise: Noise | None) -> dict[str, Choice]:
    """The best maneuvers of what was seen, by whether the choice knows of the noise; without one it does not.

    All vehicles cooperate, and no intervention is a choice too. Who knows of the errors chooses, of the maneuvers that
    are best in what was seen, the one of least expected time loss in the mean over traffics drawn around it.
    """
    table = rank_maneuvers(predictor, traffic, limit=LIMIT)
    seen_table = rank_maneuvers(predictor, seen, limit=LIMIT)
    plans = [seen.words(row) for row in _allowed(seen_table)["priorities"]]  # no intervention orders nothing
    chosen = {UNAWARE: plans[0]}
    if noise is not None:
        candidates = list(dict.fromkeys([*plans[:CANDIDATES], ()]))
        chosen[AWARE] = _least_in_the_mean(predictor, seen, candidates, noise)
    return {name: _judged(predictor, traffic, table, plan) for name, plan in chosen.items()}


def _allowed(table: pd.DataFrame) -> pd.DataFrame:
    """What may be chosen: what is safe, and no intervention."""
    return table[table["safe"] | ~table["intervention"]]


def _least_in_the_mean(
    predictor: Predictor, seen: Traffic, candidates: Sequence[Priorities], noise: Noise
) -> Priorities:
    """The candidate of least time loss over the draws; what cannot be carried out in one is no intervention there."""
    generator = np.random.default_rng(noise.seed)
    total = np.zeros(len(candidates))
    draws = 0
    for _ in range(TRIES):
        try:
            draw = drawn(seen, noise, generator)
        except ValueError:  # vehicles overlap in it
            continue
        total += [expected_time_loss(predictor, draw, plan)[0] for plan in candidates]
        draws += 1
        if draws == noise.draws:
            break
    return candidates[int(total.argmin())]


def _judged(predictor: Predictor, traffic: Traffic, table: pd.DataFrame, plan: Priorities) -> Choice:
    """A plan, in the traffic as it is; table: of its maneuvers."""
    best = _allowed(table).iloc[0]
    lost, refused, unsafe = expected_time_loss(predictor, traffic, plan)
    mine = still_open(traffic, () if refused else plan)
    same = bool(np.array_equal(_completed(predictor, traffic, mine), best["priorities"]))
    regret = round(lost - float(best["total_time_loss"]), 6)  # further digits are those of another order of summing
    return Choice(same, refused, unsafe, regret + 0.0)


def _completed(predictor: Predictor, traffic: Traffic, priorities: NDArray[np.int8]) -> NDArray[np.int8]:
    """With what follows from them."""
    found = predictor.predict(traffic, priorities).priorities
    assert found is not None
    completed: NDArray[np.int8] = found[0]
    return completed


def expected_time_loss(predictor: Predictor, traffic: Traffic, plan: Priorities) -> tuple[float, bool, bool]:
    """Of all vehicles [s], with a plan's pairs that are open imposed; whether it is refused; whether it is unsafe.

    A plan that is refused leaves no intervention.
    """
    try:
        found = forecast(predictor, traffic, still_open(traffic, plan), mass=1.0, limit=LIMIT)
        refused = False
    except ValueError:
        found = forecast(predictor, traffic, mass=1.0, limit=LIMIT)
        refused = True
    near = found.prediction.minimum_distance[0] < LEAST_DISTANCE
    return float(found.expected_time_loss().sum()), refused, bool(near and plan and not refused)
