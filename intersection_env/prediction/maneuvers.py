"""Crossing orders: enumerated, predicted and ranked by the time they save."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.arguments import check_type, number, whole_number
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    import pandas as pd

WORTHWHILE_GAIN: float = _core.WORTHWHILE_GAIN  # [s]
LIMIT: int = _core.MOST_MANEUVERS
COUNT_LIMIT: int = _core.MOST_COUNTED
BATCH = 1024
ALL = 2**63 - 1
COLUMNS = (
    "order", "gain", "total_time_loss", "worst_time_loss", "chance_worthwhile", "chance_unsafe", "priorities",
    "intervention", "followed", "worth_executing", "minimum_distance", "safe",
)  # fmt: skip
"""Of a ranking. What a narrow terminal shows is the first and the last ones."""
RANKED_BY = ("expectation", "prediction")


def crossing_orders(
    traffic: Traffic,
    cooperative: Collection[str] | None = None,
    *,
    preferred: NDArray[np.int8] | None = None,
    batch: int = BATCH,
) -> Iterator[NDArray[np.int8]]:
    """Streams every feasible crossing order, as int8 (order, pair) in batches.

    Args:
        traffic: the vehicles now.
        cooperative: ids of vehicles that take instructions; only pairs of two of them are ordered, the others
            stay 0 (left to the gap decision) unless they follow from those under the lane order. None: all.
        preferred: (pair,) an order near which to begin.
        batch: orders a batch, at most.

    Raises:
        TypeError: an argument of another type, `cooperative` is one id, or `preferred` no int8.
        ValueError: an unknown vehicle, a batch below 1, or a `preferred` of another shape.
    """
    check_type("traffic", traffic, Traffic)
    if whole_number("batch", batch) < 1:
        raise ValueError(f"batch must be at least 1, not {batch}")
    search = _search(traffic, cooperative, preferred)
    while len(orders := search.next(batch)):
        yield orders


def rank_maneuvers(
    predictor: Predictor,
    traffic: Traffic,
    cooperative: Collection[str] | None = None,
    *,
    limit: int | Literal["cycle"] | None = "cycle",
    seconds: float | None = None,
    by: Literal["expectation", "prediction"] | None = None,
) -> pd.DataFrame:
    """Predicts every crossing order and ranks them: safe, unsafe, not followed, and each by the total time loss.

    By expectation, each row is over the orders that the vehicles may find, with their probabilities (`forecast`): a
    maneuver's over those that hold what it imposes, no intervention's over all that are predicted. By prediction, each
    is the one prediction in which all that is not imposed is left to the gap decision.

    Args:
        predictor: who drives.
        traffic: the vehicles now.
        cooperative: as in `crossing_orders`.
        limit: predict at most so many orders, beginning with those that keep the order of no intervention
            among most pairs, or, by expectation, with the most probable one; None: all, however many. "cycle": as many
            as a planner's cycle has time for, some 50 ms on one core: 2,400,000 over the squared number of vehicles, at
            most 10,000. How many were left out stands in `attrs["left_out"]` (those never found counted up to 20,000).
        seconds: begin no further batch of 256 orders after so long; what comes out then depends on the machine, and
            those left out that were never found are counted up to 1,024, by prediction up to 2,048.
        by: None: expectation where the policy holds an order network, as those that ship do, else prediction.

    Returns:
        One row an order that imposes something, and one for no intervention: `order` (in words), `gain` against no
        intervention, `total_time_loss` and `worst_time_loss` (of any vehicle) [s], means by expectation; by expectation
        also `chance_worthwhile` (that the gain exceeds 2 s, if what happens with and without were drawn apart) and
        `chance_unsafe` (that the order is not followed, or bodies come nearer than 0.5 m); `worth_executing` (safe, and
        a gain above 2 s), `minimum_distance` [m], `followed` (in the order's own prediction nobody enters a conflict
        before the vehicle that the order puts first has cleared it) and `safe` (followed, and at least 0.5 m), by
        expectation those of the most probable order; `intervention` (bool), `priorities` ((pair,) int8, as
        `Predictor.predict` takes them; `Traffic.words` names them).

    Raises:
        TypeError: an argument of another type, or `cooperative` is one id, not a collection of them.
        ValueError: an unknown vehicle, a limit below 1, seconds not above 0, an unknown `by`, or an expectation of a
            policy without an order network.
    """
    import pandas as pd

    columns, left_out = ranked_arrays(predictor, traffic, cooperative, limit=limit, seconds=seconds, by=by)
    priorities = columns.pop("priorities")
    order = np.array(in_words(traffic, priorities), dtype=object)
    order[~columns["intervention"]] = "no intervention"
    table = pd.DataFrame({"order": order, **columns, "priorities": list(priorities)})
    table = table[[name for name in COLUMNS if name in table]]
    table.attrs["left_out"] = left_out
    return table


def ranked_arrays(
    predictor: Predictor,
    traffic: Traffic,
    cooperative: Collection[str] | None = None,
    *,
    limit: int | Literal["cycle"] | None = "cycle",
    seconds: float | None = None,
    by: Literal["expectation", "prediction"] | None = None,
) -> tuple[dict[str, NDArray[Any]], int]:
    """The columns of `rank_maneuvers` but for the words, (row,), `priorities` (row, pair); and how many were left out.

    Raises:
        TypeError, ValueError: as in `rank_maneuvers`.
    """
    check_type("predictor", predictor, Predictor)
    check_type("traffic", traffic, Traffic)
    most = _most(limit)
    if by not in (*RANKED_BY, None):
        raise ValueError(f'by must be "expectation", "prediction" or None, not {by!r}')
    by_expectation = predictor.core_policy.can_forecast if by is None else by == "expectation"
    if by_expectation and not predictor.core_policy.can_forecast:
        raise ValueError(f'the policy "{predictor.name}" holds no order network, so nothing can be expected of it')
    flags, spent = _flags(traffic, cooperative), seconds_budget(seconds)
    bound = predictor.bound_to(traffic.intersection)
    columns, left_out = _core.rank_maneuvers(bound, traffic.core, flags, most, spent, by_expectation)
    if not by_expectation:
        del columns["chance_worthwhile"], columns["chance_unsafe"]
    return columns, left_out


def _most(limit: int | Literal["cycle"] | None) -> int | None:
    """As the core takes it, which reads None as "cycle"."""
    if limit == "cycle":
        return None
    if limit is None:
        return ALL
    if isinstance(limit, str):
        raise ValueError(f'limit is {limit!r}; wanted a whole number, None or "cycle"')
    if whole_number("limit", limit) < 1:
        raise ValueError(f"limit must be at least 1, not {limit}")
    return int(limit)


def seconds_budget(seconds: float | None) -> float:
    """As the core takes a time that may be spent: without one, infinite."""
    if seconds is not None and not number("seconds", seconds) > 0.0:
        raise ValueError(f"seconds must be above 0, not {seconds}")
    return np.inf if seconds is None else float(seconds)


def _flags(traffic: Traffic, cooperative: Collection[str] | None) -> NDArray[np.uint8]:
    if isinstance(cooperative, str):
        raise TypeError(f'cooperative must be a collection of vehicle ids, not the one id "{cooperative}"')
    flags = np.full(len(traffic), cooperative is None, np.uint8)
    for vehicle_id in cooperative or ():
        flags[traffic.index(vehicle_id)] = 1
    return flags


def _search(traffic: Traffic, cooperative: Collection[str] | None, preferred: NDArray[np.int8] | None) -> _core.Orders:
    flags = _flags(traffic, cooperative)
    if preferred is None:
        preferred = np.full(len(traffic.conflicts), -1, np.int8)
    if preferred.dtype != np.int8:
        raise TypeError(f"preferred must be int8, not {preferred.dtype}")
    if preferred.shape != (len(traffic.conflicts),):
        raise ValueError(f"preferred must have shape ({len(traffic.conflicts)},), not {preferred.shape}")
    preferred = np.ascontiguousarray(preferred)
    return _core.Orders(traffic.intersection.core, traffic.core, flags, preferred)


def in_words(traffic: Traffic, orders: NDArray[np.int8]) -> list[str]:
    """Orders (order, pair) as sequences of vehicles, "07/15, 07/12, 07/31": each before those that follow.

    Among vehicles that need not wait for each other, the one nearer to its stop line comes first.
    """
    return _core.in_words(traffic.intersection.core, traffic.core, list(traffic.ids), orders)
