"""How probable each recorded crossing order was by the order network, and by others: what its scores are taken of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression

from agents.orders.samples import OrderSample
from experiments.models.patient import drawn_yielder_first
from experiments.show.forecast import BOOSTING, BOOSTING_PAIR, DRAWN, JOINT, PAIR, SUMO_CALIBRATED
from intersection_env.evaluation.moments import Moment, contested
from intersection_env.evaluation.recorded_order import scored_order
from intersection_env.prediction.forecast import forecast
from intersection_env.prediction.maneuvers import LIMIT, crossing_orders
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor

Chances = NDArray[np.float64]
CLOSEST = 1e-6  # a probability is never nearer to 0 and 1 in a log loss


@dataclass(frozen=True, eq=False)
class OrderChances:
    """Pairs of cars and trucks whose recorded order is known within the horizon.

    recording, place: (pair,) names. yielder_first: (pair,) bool, what was recorded. is_open: (pair,) bool, neither has
    reached the conflict at the start. recorded: (pair,) bool, both are recorded there. sumo: (pair,) int8, the order by
    SUMO's rule, 0 where unresolved. joint, pair: (pair,) the probability of the yielder going first by the order
    network, over all feasible orders and by itself. boosting, boosting_pair: likewise by gradient boosting.
    sumo_calibrated: (pair,) by a logistic calibration of SUMO's rule. drawn: (pair,) by predictions without orders, the
    drivers' patience drawn.
    """

    recording: NDArray[np.str_]
    place: NDArray[np.str_]
    yielder_first: NDArray[np.bool_]
    is_open: NDArray[np.bool_]
    recorded: NDArray[np.bool_]
    sumo: NDArray[np.int8]
    joint: Chances
    pair: Chances
    boosting: Chances
    boosting_pair: Chances
    sumo_calibrated: Chances
    drawn: Chances

    def of(self, model: str) -> Chances:
        """(pair,) a model's probability that the yielder goes first."""
        by_name = {JOINT: self.joint, PAIR: self.pair, BOOSTING: self.boosting, BOOSTING_PAIR: self.boosting_pair}
        return (by_name | {SUMO_CALIBRATED: self.sumo_calibrated, DRAWN: self.drawn})[model]


@dataclass(frozen=True)
class Learned:
    """What others than the order network have learned from the same training moments."""

    boosting: HistGradientBoostingClassifier
    sumo: LogisticRegression

    @classmethod
    def of(cls, samples: Sequence[OrderSample], moments: Sequence[Moment], sumo: Predictor) -> Learned:
        """Gradient boosting of the same features on the same pairs; how often SUMO's rule is right in these moments."""
        known = [sample.recorded != 0 for sample in samples]
        features = np.concatenate([one.features[there] for one, there in zip(samples, known, strict=True)])
        first = np.concatenate([one.recorded[there] > 0 for one, there in zip(samples, known, strict=True)])
        boosting = HistGradientBoostingClassifier(random_state=0).fit(features, first)
        rule, truth = [], []
        for moment in contested(moments):
            order, _ = scored_order(moment)
            rule.append(crossing_order(moment.traffic, sumo.predict(moment.traffic))[0][order != 0])
            truth.append(order[order != 0] > 0)
        calibrated = LogisticRegression().fit(_as_feature(np.concatenate(rule)), np.concatenate(truth))
        return cls(boosting, calibrated)


def _as_feature(order: NDArray[np.int8]) -> Chances:
    """Whether SUMO's rule says that the yielder goes first, and whether it says nothing: (pair, 2)."""
    return np.stack([order > 0, order == 0], axis=1).astype(np.float64)


def order_chances(predictor: Predictor, learned: Learned, moments: Sequence[Moment], sumo: Predictor) -> OrderChances:
    """The pairs of these moments.

    Raises:
        ValueError: there is none.
    """
    parts = [one for moment in contested(moments) if (one := _of_moment(predictor, learned, moment, sumo)) is not None]
    if not parts:
        raise ValueError(f"no pair of vehicles of known order in {len(moments)} moments")
    names = [field.name for field in fields(OrderChances)]
    return OrderChances(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _of_moment(predictor: Predictor, learned: Learned, moment: Moment, sumo: Predictor) -> OrderChances | None:
    traffic = moment.traffic
    known, steps = scored_order(moment)
    chosen = known != 0
    if not chosen.any():
        return None
    observed = np.array([track.observed[moment.step - track.start] for track in moment.tracks()], np.bool_)
    features = predictor.bound_to(traffic.intersection).observe_orders(traffic.core)
    logit = predictor.core_policy.evaluate_order(features).astype(np.float64)
    boosted = learned.boosting.predict_proba(features)[:, 1].clip(CLOSEST, 1.0 - CLOSEST)
    rule = crossing_order(traffic, sumo.predict(traffic))[0][chosen]
    return OrderChances(
        recording=np.full(chosen.sum(), moment.scene.recording),
        place=np.full(chosen.sum(), traffic.intersection.name),
        yielder_first=known[chosen] > 0,
        is_open=steps[chosen] > 0,
        recorded=observed[traffic.conflicts[chosen]].all(axis=1),
        sumo=rule,
        joint=forecast(predictor, traffic, most=1).yielder_first[chosen],
        pair=1.0 / (1.0 + np.exp(-logit[chosen])),
        boosting=_joint(moment, boosted)[chosen],
        boosting_pair=boosted[chosen],
        sumo_calibrated=learned.sumo.predict_proba(_as_feature(rule))[:, 1],
        drawn=drawn_yielder_first(predictor, traffic)[chosen],
    )


def _joint(moment: Moment, chance: Chances) -> Chances:
    """The chances of pairs (pair,) normalised over the feasible orders, as the core does with the network's."""
    orders = next(crossing_orders(moment.traffic, batch=LIMIT), np.zeros((0, len(chance)), np.int8))
    if not len(orders):
        return chance
    weight = 0.5 * orders @ np.log(chance / (1.0 - chance))
    share = np.exp(weight - weight.max())
    share /= share.sum()
    left_open = share @ (orders == 0)
    joint: Chances = share @ (orders > 0) + left_open * chance
    return joint
