"""Crossing orders as the page lists them: by expected gain, and how probable each is if nobody intervenes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.prediction.forecast import Forecast, forecast
from intersection_env.prediction.maneuvers import WORTHWHILE_GAIN, rank_maneuvers
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic
from intersection_env.viewer.asked import Asked

if TYPE_CHECKING:
    import pandas as pd

FIRST, PROBABLE = 30, 12  # ours: rows that are listed by gain, and by probability: what somebody may read
FIGURES = {
    "gain": "gain",
    "loss": "total_time_loss",
    "worst": "worst_time_loss",
    "worthwhile": "chance_worthwhile",
    "unsafe": "chance_unsafe",
    "distance": "minimum_distance",
}
"""Of a row on the page, and of a ranking."""


def ranked(predictor: Predictor, asked: Asked) -> dict[str, Any]:
    """The best orders and the most probable ones, of those that keep to what is assigned, and nothing but that.

    Gains are against what is expected with what is assigned and nothing else: no intervention, where nothing is.
    `probability` is that of the order if nobody intervenes but as assigned, and null without a forecast; `atMost` is
    true where it is only known to be below that of those that are listed. `differs` are the pairs (first, second) in
    which an order is another than what happens without it.
    """
    traffic, given = asked.traffic, asked.priorities
    table = rank_maneuvers(predictor, traffic)
    likely = forecast(predictor, traffic, given) if predictor.core_policy.can_forecast else None
    alone = predictor.predict(traffic, given) if likely is None else likely.prediction
    usual = crossing_order(traffic, alone)[0] if likely is None else likely.orders[0]
    if given.any():
        table = _against(table, alone.time_loss, None if likely is None else likely.weight)
    orders = _orders(table, traffic)
    keeps = ((orders == given) | (given == 0)).all(axis=1) & table["intervention"].to_numpy(np.bool_)
    place = {} if likely is None else {order.tobytes(): k for k, order in enumerate(likely.orders)}
    probable = np.array([place.get(order.tobytes(), len(place)) for order in orders], np.int64)
    chosen = np.flatnonzero(keeps)
    listed = np.unique([*chosen[:FIRST], *chosen[probable[chosen] < min(PROBABLE, len(place))]]).astype(int).tolist()
    rows = [
        _row(row, figures, traffic, orders[row], usual) | _probability(likely, int(probable[row]))
        for row, figures in zip(listed, table.iloc[listed].to_dict("records"), strict=True)
    ]
    none = table[~table["intervention"]].to_dict("records")[0]
    return {
        "by": "prediction" if likely is None else "expectation",
        "worthwhileGain": WORTHWHILE_GAIN,
        "none": _figures(none),
        "rows": rows,
        "orders": int(keeps.sum()),
        "leftOut": int(table.attrs["left_out"]),
    }


def _against(table: pd.DataFrame, time_loss: NDArray[np.float32], weight: NDArray[np.float64] | None) -> pd.DataFrame:
    """A ranking, its gains against these time losses (scenario, vehicle) and weights instead of no intervention.

    Each row is one order, as all take instructions, and so has one time loss. How safe it is without is not said.
    """
    weight = np.ones(1) if weight is None else weight
    losses = time_loss.sum(axis=1, dtype=np.float64)
    none = ~table["intervention"].to_numpy(np.bool_)
    total = np.where(none, weight @ losses, table["total_time_loss"])
    gain = weight @ losses - total
    more = (losses[:, None] - total > WORTHWHILE_GAIN).T @ weight
    changed = {
        "total_time_loss": total,
        "worst_time_loss": np.where(none, weight @ time_loss.max(axis=1, initial=0.0), table["worst_time_loss"]),
        "gain": gain,
        "minimum_distance": table["minimum_distance"].mask(none),
        "worth_executing": table["safe"] & (gain > WORTHWHILE_GAIN),
    }
    if "chance_worthwhile" in table:
        changed |= {
            "chance_worthwhile": np.where(none, 0.0, more),
            "chance_unsafe": table["chance_unsafe"].mask(none),
        }
    return table.assign(**changed)


def _orders(table: pd.DataFrame, traffic: Traffic) -> NDArray[np.int8]:
    return np.stack(table["priorities"].tolist()).reshape(len(table), len(traffic.conflicts))


def _row(
    row: int, figures: Mapping[Any, Any], traffic: Traffic, order: NDArray[np.int8], usual: NDArray[np.int8]
) -> dict[str, Any]:
    other = np.where(order != usual, order, 0).astype(np.int8)
    return {
        "rank": row + 1,
        "order": figures["order"].split(", "),
        "priorities": order.tolist(),
        "differs": [list(pair) for pair in dict.fromkeys(traffic.words(other))],
        "followed": bool(figures["followed"]),
        "safe": bool(figures["safe"]),
        "worthExecuting": bool(figures["worth_executing"]),
        **_figures(figures),
    }


def _figures(figures: Mapping[Any, Any]) -> dict[str, float | None]:
    """Numbers of a row; null where the ranking has none, or an infinite one."""
    found = {name: float(figures[column]) for name, column in FIGURES.items() if column in figures}
    return dict.fromkeys(FIGURES) | {name: round(one, 3) for name, one in found.items() if np.isfinite(one)}


def _probability(likely: Forecast | None, place: int) -> dict[str, float | bool | None]:
    if likely is None:
        return {"probability": None, "atMost": False}
    last = len(likely.probability) - 1
    return {"probability": round(float(likely.probability[min(place, last)]), 4), "atMost": place > last}
