"""What to drive at a recorded moment: the best safe maneuver of each ranking, and who drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.models.driven_on import Job, drivers_of
from intersection_env.constants import STEPS
from intersection_env.evaluation.moments import Moment
from intersection_env.prediction.maneuvers import RANKED_BY, rank_maneuvers
from intersection_env.prediction.predictor import Predictor

if TYPE_CHECKING:
    import pandas as pd

LATER = 2 * STEPS  # driven in all
SEARCHED = 12  # orders of a moment at most, of which all are driven

Order = NDArray[np.int8]


class Promise(NamedTuple):
    """The best safe maneuver of a ranking: gain predicted [s], and the chance that it exceeds 2 s, NaN if unknown."""

    gain: float
    order: Order
    chance: float = np.nan


class Plan(NamedTuple):
    """What is driven at one moment.

    best: by ranking, None where no maneuver is safe. orders: the runs beside the
    one without. all_driven: whether they are all feasible orders.
    """

    moment: Moment
    best: Mapping[str, Promise | None]
    orders: tuple[Order, ...]
    all_driven: bool


def plan_of(predictor: Predictor, moment: Moment) -> Plan:
    """The best safe maneuver of each ranking, and all orders where they are few."""
    best: dict[str, Promise | None] = {}
    driven: dict[bytes, Order] = {}
    for by in RANKED_BY:
        ranked = rank_maneuvers(predictor, moment.traffic, by=by)  # type: ignore[arg-type]
        orders = ranked[ranked.intervention]
        safe = orders[orders.safe]
        best[by] = _promise(safe.iloc[0]) if len(safe) else None
        all_driven = len(orders) + ranked.attrs["left_out"] <= SEARCHED
        wanted = orders.priorities if all_driven else safe.priorities.iloc[:1]
        driven |= {order.tobytes(): order for order in wanted}
    return Plan(moment, best, tuple(driven.values()), all_driven)


def _promise(row: pd.Series[Any]) -> Promise:
    return Promise(float(row.gain), row.priorities, float(row.get("chance_worthwhile", np.nan)))


def jobs_of(plan: Plan, number: int, seed: int) -> tuple[Job, Job]:
    """What SUMO has to drive, and once more without maneuver under another seed of its own."""
    kinds = [track.road_user for track in plan.moment.tracks()]
    drivers = drivers_of(plan.moment.traffic, kinds, seed, number)
    own, other = np.random.default_rng((seed, number)).integers(2**31 - 1, size=2).tolist()
    traffic = plan.moment.traffic
    return Job(traffic, drivers, own, (None, *plan.orders), LATER), Job(traffic, drivers, other, (None,), LATER)
