"""Crossing orders: enumerated, predicted and ranked by the time they save."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.metrics import crossing_order
from intersection_env.predictor import Predictor
from intersection_env.traffic import Traffic

if TYPE_CHECKING:
    import pandas as pd

SAFE_DISTANCE = 0.5  # [m], paper, Table II: closer counts as a collision
WORTHWHILE_GAIN = 2.0  # [s], paper, Section IV-C.3: a gain beyond the error of the predicted time loss
BATCH = 1024
LIMIT = 10_000  # ours: a second's work; a dense traffic can have millions of orders
COUNT_LIMIT = 20_000  # ours: orders left out are counted this far, which takes some 25 ms


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
        TypeError: `cooperative` is one id, or `preferred` no int8.
        ValueError: an unknown vehicle, a batch below 1, or a `preferred` of another shape.
    """
    if batch < 1:
        raise ValueError(f"batch must be at least 1, not {batch}")
    search = _search(traffic, cooperative, preferred)
    while len(orders := search.next(batch)):
        yield orders


def rank_maneuvers(
    predictor: Predictor,
    traffic: Traffic,
    cooperative: Collection[str] | None = None,
    *,
    limit: int | None = LIMIT,
) -> pd.DataFrame:
    """Predicts every crossing order and ranks them: safe ones first, then by the total time loss.

    Args:
        predictor: who drives.
        traffic: the vehicles now.
        cooperative: as in `crossing_orders`.
        limit: predict at most so many orders, beginning with those that keep the order of no intervention
            among most pairs; None: all, however many. How many were left out stands in `attrs["left_out"]`
            (counted up to 20,000).

    Returns:
        One row an order and one for no intervention: `order` (in words), `total_time_loss`, `worst_time_loss`
        (of any vehicle) and `gain` against no intervention [s], `worth_executing` (safe, and a gain above 2 s),
        `minimum_distance` [m], `safe` (at least 0.5 m), `intervention` (bool), `priorities` ((pair,) int8,
        as `Predictor.predict` takes them; `Traffic.words` names them).

    Raises:
        TypeError: `cooperative` is one id, not a collection of them.
        ValueError: an unknown vehicle, or a limit below 1.
    """
    import pandas as pd

    if limit is not None and limit < 1:
        raise ValueError(f"limit must be at least 1, not {limit}")
    default = predictor.predict(traffic)
    realized = crossing_order(traffic, default)[0]
    search = _search(traffic, cooperative, realized)
    frames = [
        _rows(traffic, np.zeros((1, len(traffic.conflicts)), np.int8), default.time_loss, default.minimum_distance)
    ]
    remaining = limit if limit is not None else np.iinfo(np.int64).max
    while remaining > 0 and len(orders := search.next(min(BATCH, remaining))):
        remaining -= len(orders)
        summary = predictor.predict(traffic, orders, trajectories=False)
        frames.append(_rows(traffic, orders, summary.time_loss, summary.minimum_distance))
    table = pd.concat(frames, ignore_index=True)
    table["intervention"] = table.index > 0
    table.loc[0, "order"] = "no intervention"
    table["gain"] = table["total_time_loss"].iloc[0] - table["total_time_loss"]
    table["worth_executing"] = table["safe"] & (table["gain"] > WORTHWHILE_GAIN)
    table = table.sort_values(["safe", "total_time_loss"], ascending=[False, True], kind="stable", ignore_index=True)
    table.attrs["left_out"] = search.count_remaining(COUNT_LIMIT) if limit is not None else 0
    columns = ["order", "total_time_loss", "worst_time_loss", "gain", "worth_executing", "minimum_distance", "safe"]
    return table[[*columns, "intervention", "priorities"]]


def _search(traffic: Traffic, cooperative: Collection[str] | None, preferred: NDArray[np.int8] | None) -> _core.Orders:
    if isinstance(cooperative, str):
        raise TypeError(f'cooperative must be a collection of vehicle ids, not the one id "{cooperative}"')
    flags = np.full(len(traffic), cooperative is None, np.uint8)
    for vehicle_id in cooperative or ():
        flags[traffic.index(vehicle_id)] = 1
    if preferred is None:
        preferred = np.full(len(traffic.conflicts), -1, np.int8)
    if preferred.dtype != np.int8:
        raise TypeError(f"preferred must be int8, not {preferred.dtype}")
    if preferred.shape != (len(traffic.conflicts),):
        raise ValueError(f"preferred must have shape ({len(traffic.conflicts)},), not {preferred.shape}")
    preferred = np.ascontiguousarray(preferred)
    return _core.Orders(traffic.intersection.core, traffic.core, flags, preferred)


def _rows(
    traffic: Traffic, orders: NDArray[np.int8], time_loss: NDArray[np.float32], distance: NDArray[np.float32]
) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(
        {
            "order": in_words(traffic, orders),
            "total_time_loss": time_loss.sum(axis=1, dtype=np.float64),
            "worst_time_loss": time_loss.max(axis=1, initial=0.0).astype(np.float64),
            "minimum_distance": distance.astype(np.float64),
            "safe": distance >= SAFE_DISTANCE,
            "priorities": list(orders),
        }
    )


def in_words(traffic: Traffic, orders: NDArray[np.int8]) -> list[str]:
    """Orders (order, pair) as sequences of vehicles, "07/15, 07/12, 07/31": each before those that follow.

    Among vehicles that need not wait for each other, the one nearer to its stop line comes first.
    """
    words = []
    for sequence in _sequences(traffic, orders).tolist():
        words.append(", ".join(traffic.ids[i] for i in sequence if i >= 0) or "nobody waits")
    return words


def _sequences(traffic: Traffic, orders: NDArray[np.int8]) -> NDArray[np.int64]:
    """(order, place): vehicle indices in crossing order, -1 behind the last."""
    count = len(traffic)
    waits_for = np.zeros((len(orders), count, count), np.bool_)  # [order, second, first]
    involved = np.zeros((len(orders), count), np.bool_)
    for (yielder, prioritized), way in zip(traffic.conflicts.tolist(), orders.T, strict=True):
        waits_for[:, prioritized, yielder] |= way > 0
        waits_for[:, yielder, prioritized] |= way < 0
        involved[:, [yielder, prioritized]] |= (way != 0)[:, None]
    waits_for |= _behind(traffic)
    to_line = np.array([traffic.intersection.routes[r].stop_line for r in traffic.route]) - traffic.position
    sequence = np.full((len(orders), count), -1)
    for place in range(count):
        ready = involved & ~(waits_for & involved[:, None, :]).any(axis=2)
        nearest = np.where(ready, to_line, np.inf).argmin(axis=1)
        found = ready.any(axis=1)
        sequence[found, place] = nearest[found]
        involved[found, nearest[found]] = False
    return sequence


def _behind(traffic: Traffic) -> NDArray[np.bool_]:
    """(vehicle, vehicle): whether the first queues somewhere behind the second in its stop lane."""
    behind = np.zeros((len(traffic), len(traffic)), np.bool_)
    arcs = _core.lane_order(traffic.intersection.core, traffic.core)
    for ahead, follower in arcs.tolist():  # front to back, so everybody ahead is known already
        behind[follower] |= behind[ahead]
        behind[follower, ahead] = True
    return behind
