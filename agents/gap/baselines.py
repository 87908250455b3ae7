"""What the gap network is measured against: rules, and scikit-learn models of the same four features.

Each baseline is a function of the training samples (rules ignore them) to a `Decider`; `BASELINES` names them all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression

from agents.gap.samples import UNKNOWN, GapSamples, Kinematics
from agents.networks.gap import GAP_SCALE, GAP_SHIFT
from intersection_env.features import Gap

EVEN = 0.5  # a gap is accepted where acceptance is more probable than not
SEED = 0
NEAREST = 3
TIME_GAP = 1.0  # [s], SUMO's jmTimegapMinor
ACCELERATION, DECELERATION = 2.6, 4.5  # [m/s²], SUMO's defaults for passenger cars
HEADWAY = 1.0  # [s], SUMO's tau
HALTING_SPEED = 0.1  # [m/s], SUMO_const_haltingSpeed
LEAST_MEAN_SPEED = 0.001  # [m/s], SUMO's NUMERICAL_EPS

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Decider(Protocol):
    """Who decides whether yielders take their gaps."""

    def accepts(self, samples: GapSamples) -> Flags | None:
        """(pair,) the decision of each pair; None where there is only one for all foes together."""

    def decide(self, samples: GapSamples) -> Flags:
        """(sample,) whether the yielder goes before all its foes."""

    def probability(self, samples: GapSamples) -> Floats | None:
        """(sample,) how probable it is that the yielder goes before all its foes; None for rules."""


@dataclass(frozen=True)
class PairRule:
    """Decides each pair (pair,) by a rule; a yielder goes if it may before each foe."""

    rule: Callable[[GapSamples], Flags]

    def accepts(self, samples: GapSamples) -> Flags | None:
        return self.rule(samples)

    def decide(self, samples: GapSamples) -> Flags:
        return samples.decide(self.rule(samples))

    def probability(self, samples: GapSamples) -> Floats | None:
        return None


@dataclass(frozen=True)
class PairModel:
    """Gives each pair (pair,) a probability of accepting; the least of a yielder's pairs is the yielder's."""

    chance: Callable[[GapSamples], Floats]

    def accepts(self, samples: GapSamples) -> Flags | None:
        return self.chance(samples) > EVEN

    def decide(self, samples: GapSamples) -> Flags:
        return samples.least(self.chance(samples)) > EVEN

    def probability(self, samples: GapSamples) -> Floats | None:
        return samples.least(self.chance(samples))


@dataclass(frozen=True)
class SampleModel:
    """Gives each sample (sample,) one probability, from all its foes together."""

    chance: Callable[[GapSamples], Floats]

    def accepts(self, samples: GapSamples) -> Flags | None:
        return None

    def decide(self, samples: GapSamples) -> Flags:
        return self.chance(samples) > EVEN

    def probability(self, samples: GapSamples) -> Floats | None:
        return self.chance(samples)


def always_wait(train: GapSamples) -> Decider:
    """Nobody goes before a foe; of two vehicles, the one with priority first, so also called priority-first."""
    return PairRule(lambda samples: np.zeros(len(samples.sample), np.bool_))


def critical_gap(train: GapSamples) -> Decider:
    """A foe 6 s away is let pass when crossing, one 4 s away when merging; the core's decision."""
    return PairRule(lambda samples: samples.critical_gap)


def sumo(train: GapSamples) -> Decider:
    """SUMO's rule with everybody at v_max, as the paper has it; the core's decision."""
    return PairRule(lambda samples: samples.sumo)


def sumo_kinematic(train: GapSamples) -> Decider:
    """SUMO's rule with vehicles that accelerate, see `sumo_accepts`."""
    return PairRule(sumo_accepts)


def logistic(train: GapSamples) -> Decider:
    """Logistic regression on the four features of a pair, scaled as the network's."""
    model = LogisticRegression(max_iter=1000, random_state=SEED)  # the default, a slight L2 penalty
    return _pair_model(model, train, lambda samples: _scaled(samples.features))


def boosting(train: GapSamples) -> Decider:
    """Gradient boosting on the four features of a pair."""
    return _pair_model(_boosting(), train, lambda samples: samples.features.astype(np.float64))


def boosting_three(train: GapSamples) -> Decider:
    """Gradient boosting on all features of the three nearest foes: the ceiling, for it sees them together.

    Features with one value alone are left out, as where nobody ever has three foes: scikit-learn fails on them.
    """
    foes = nearest_foes(train)
    varies = np.array([len(np.unique(column[~np.isnan(column)])) > 1 for column in foes.T])
    model = _boosting().fit(foes[:, varies], train.labels())
    return SampleModel(lambda samples: _chance(model, nearest_foes(samples)[:, varies]))


BASELINES: dict[str, Callable[[GapSamples], Decider]] = {
    "always_wait": always_wait,
    "critical_gap": critical_gap,
    "sumo": sumo,
    "sumo_kinematic": sumo_kinematic,
    "logistic": logistic,
    "boosting": boosting,
    "boosting_three": boosting_three,
}


def nearest_foes(samples: GapSamples) -> Floats:
    """(sample, 12) the features of the three foes nearest to, or furthest beyond, their stop lines.

    NaN where there are fewer: scikit-learn's boosting takes that for "missing".
    """
    order = np.lexsort((samples.features[:, Gap.FOE_DISTANCE_TO_STOP_LINE], samples.sample))
    sample = samples.sample[order]
    rank = np.arange(len(sample)) - np.searchsorted(sample, sample)
    kept = rank < NEAREST
    result = np.full((len(samples), NEAREST, len(Gap)), np.nan)
    result[sample[kept], rank[kept]] = samples.features[order[kept]]
    return result.reshape(len(samples), -1)


@dataclass(frozen=True)
class _Passage:
    """When a vehicle is at its stop line and out of the conflict [s] from now, and how fast [m/s]; all (pair,)."""

    arrival: Floats
    leave: Floats
    arrival_speed: Floats
    leave_speed: Floats


def sumo_accepts(samples: GapSamples) -> Flags:
    """(pair,) SUMO's right-of-way rule with vehicles that accelerate, impatience 0.

    The yielder goes if the foe has left before it arrives, or arrives more than `TIME_GAP` after it has left. When
    merging, the later one must further be slow enough to stay behind the earlier one, and as a follower the yielder
    keeps `TIME_GAP` too.

    Ours, where samples know less than SUMO: a link lasts from the stop line to the end of the conflict (SUMO: to the
    junction's far side); v_max where a vehicle is now holds until it leaves; all vehicles accelerate and brake as
    SUMO's default car; an unimpeded vehicle comes as fast as it can, also towards a stop line where it must yield;
    a vehicle beyond its stop line arrives now, and has the rest of the way to go.

    Source: SUMO, MSLink::opened, blockedByFoe and getLeaveTime, MSCFModel::getMinimalArrivalTime.
    """
    pair = dict(zip(Gap, samples.features.astype(np.float64).T, strict=True))
    beside = dict(zip(Kinematics, samples.kinematics.astype(np.float64).T, strict=True))
    foe_to_stop, foe_speed = pair[Gap.FOE_DISTANCE_TO_STOP_LINE], pair[Gap.FOE_SPEED]
    ego = _passage(
        beside[Kinematics.DISTANCE_TO_STOP_LINE],
        pair[Gap.DISTANCE_TO_PGA],
        pair[Gap.SPEED],
        beside[Kinematics.V_MAX],
    )
    foe = _passage(foe_to_stop, beside[Kinematics.FOE_TO_LEAVE], foe_speed, beside[Kinematics.FOE_V_MAX])
    follows = foe.leave < ego.arrival
    leads = ~follows & (foe.arrival > ego.leave + TIME_GAP)
    behind = (ego.arrival - foe.leave >= TIME_GAP) & _merges_safely(foe.leave_speed, ego.arrival_speed)
    ahead = _merges_safely(ego.leave_speed, _braked(foe_to_stop, foe_speed))
    crossing = beside[Kinematics.MERGING] == 0.0
    accepted: Flags = (follows & (crossing | behind)) | (leads & (crossing | ahead))
    return accepted


def _passage(to_stop: Floats, to_leave: Floats, speed: Floats, v_max: Floats) -> _Passage:
    """Accelerates to v_max and holds it; a vehicle already faster brakes to it, as SUMO's estimates do."""
    way = np.maximum(to_stop, 0.0)
    link = to_leave - way
    arrival_speed = np.minimum(v_max, np.sqrt(speed**2 + 2.0 * ACCELERATION * way))
    change = arrival_speed - speed
    changing = np.where(change >= 0.0, change / ACCELERATION, -change / DECELERATION)
    steady = np.maximum(0.0, way - 0.5 * changing * (arrival_speed + speed))
    arrival = changing + steady / np.maximum(np.maximum(speed, arrival_speed), HALTING_SPEED)
    arrival[to_stop <= 0.0] = 0.0
    leave_speed = np.minimum(v_max, np.sqrt(arrival_speed**2 + 2.0 * ACCELERATION * np.maximum(link, 0.0)))
    mean = np.maximum(0.5 * (arrival_speed + leave_speed), LEAST_MEAN_SPEED)
    return _Passage(arrival, arrival + link / mean, arrival_speed, leave_speed)


def _braked(to_stop: Floats, speed: Floats) -> Floats:
    """(pair,) how slow a vehicle can be at its stop line, braking after `HEADWAY`: 0 where it can stop [m/s].

    Source: SUMO, MSCFModel::getMinimalArrivalSpeed.
    """
    way = np.maximum(to_stop - speed * HEADWAY, 0.0)
    slowest: Floats = np.sqrt(np.maximum(speed**2 - 2.0 * DECELERATION * way, 0.0))
    return slowest


def _merges_safely(leader: Floats, follower: Floats) -> Flags:
    """(pair,) whether the leader needs the longer way to a stand; speeds (pair,) [m/s].

    Source: SUMO, unsafeMergeSpeeds. Equal speeds are unsafe there too.
    """
    safe: Flags = leader**2 / DECELERATION > follower**2 / DECELERATION
    return safe


def _pair_model(model: Any, train: GapSamples, inputs: Callable[[GapSamples], Floats]) -> Decider:
    """Fits pairs to who was first; pairs whose order the scene does not show are left out."""
    known = train.first != UNKNOWN
    model.fit(inputs(train)[known], train.first[known] == 1)
    return PairModel(lambda samples: _chance(model, inputs(samples)))


def _chance(model: Any, inputs: Floats) -> Floats:
    """(row,) the probability of True."""
    return np.asarray(model.predict_proba(inputs)[:, 1], np.float64)


def _boosting() -> Any:
    return HistGradientBoostingClassifier(random_state=SEED)


def _scaled(features: NDArray[np.float32]) -> Floats:
    scaled: Floats = (features.astype(np.float64) - np.array(GAP_SHIFT)) * np.array(GAP_SCALE)
    return scaled
