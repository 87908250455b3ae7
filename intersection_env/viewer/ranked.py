"""Crossing orders as the page lists them: by expected gain, and how probable each is if nobody intervenes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.prediction.forecast import Forecast, forecast
from intersection_env.prediction.maneuvers import WORTHWHILE_GAIN, in_words, ranked_arrays
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic
from intersection_env.viewer.asked import Asked

Columns = dict[str, NDArray[Any]]
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
    columns, left_out = ranked_arrays(predictor, traffic)
    likely = forecast(predictor, traffic, given) if predictor.core_policy.can_forecast else None
    alone = predictor.predict(traffic, given) if likely is None else likely.prediction
    usual = crossing_order(traffic, alone)[0] if likely is None else likely.orders[0]
    if given.any():
        columns = _against(columns, alone.time_loss, None if likely is None else likely.weight)
    orders, intervenes = columns["priorities"], columns["intervention"]
    keeps = ((orders == given) | (given == 0)).all(axis=1) & intervenes
    listed = _listed(orders, keeps, likely)
    place = {} if likely is None else {order.tobytes(): k for k, order in enumerate(likely.orders)}
    words = in_words(traffic, orders[listed])
    rows = [
        {
            "rank": row + 1,
            "order": sentence.split(", "),
            **_row(columns, row, traffic, usual),
            **_probability(likely, place.get(orders[row].tobytes(), len(place))),
        }
        for row, sentence in zip(listed, words, strict=True)
    ]
    return {
        "by": "prediction" if likely is None else "expectation",
        "worthwhileGain": WORTHWHILE_GAIN,
        "none": _figures(columns, int(np.flatnonzero(~intervenes)[0])),
        "rows": rows,
        "orders": int(keeps.sum()),
        "leftOut": left_out,
    }


def _against(columns: Columns, time_loss: NDArray[np.float32], weight: NDArray[np.float64] | None) -> Columns:
    """A ranking, its gains against these time losses (scenario, vehicle) and weights instead of no intervention.

    Each row is one order, as all take instructions, and so has one time loss. How safe it is without is not said.
    """
    weight = np.ones(1) if weight is None else weight
    losses = time_loss.sum(axis=1, dtype=np.float64)
    none = ~columns["intervention"]
    total = np.where(none, weight @ losses, columns["total_time_loss"])
    gain = weight @ losses - total
    changed = {
        "total_time_loss": total,
        "worst_time_loss": np.where(none, weight @ time_loss.max(axis=1, initial=0.0), columns["worst_time_loss"]),
        "gain": gain,
        "minimum_distance": np.where(none, np.nan, columns["minimum_distance"]),
        "worth_executing": columns["safe"] & (gain > WORTHWHILE_GAIN),
    }
    if "chance_worthwhile" in columns:
        more = (losses[:, None] - total > WORTHWHILE_GAIN).T @ weight
        changed |= {
            "chance_worthwhile": np.where(none, 0.0, more),
            "chance_unsafe": np.where(none, np.nan, columns["chance_unsafe"]),
        }
    return columns | changed


def _listed(orders: NDArray[np.int8], keeps: NDArray[np.bool_], likely: Forecast | None) -> list[int]:
    """The rows that the page lists, of those that keep to what is assigned."""
    rows = set(np.flatnonzero(keeps)[:FIRST].tolist())
    for order in [] if likely is None else likely.orders[:PROBABLE]:
        rows.update(np.flatnonzero((orders == order).all(axis=1) & keeps).tolist())
    return sorted(rows)


def _row(columns: Columns, row: int, traffic: Traffic, usual: NDArray[np.int8]) -> dict[str, Any]:
    order = columns["priorities"][row]
    other = np.where(order != usual, order, 0).astype(np.int8)
    return {
        "priorities": order.tolist(),
        "differs": [list(pair) for pair in dict.fromkeys(traffic.words(other))],
        "followed": bool(columns["followed"][row]),
        "safe": bool(columns["safe"][row]),
        "worthExecuting": bool(columns["worth_executing"][row]),
        **_figures(columns, row),
    }


def _figures(columns: Columns, row: int) -> dict[str, float | None]:
    """Numbers of a row; null where the ranking has none, or an infinite one."""
    found = {name: float(columns[column][row]) for name, column in FIGURES.items() if column in columns}
    return dict.fromkeys(FIGURES) | {name: round(one, 3) for name, one in found.items() if np.isfinite(one)}


def _probability(likely: Forecast | None, place: int) -> dict[str, float | bool | None]:
    if likely is None:
        return {"probability": None, "atMost": False}
    last = len(likely.probability) - 1
    return {"probability": round(float(likely.probability[min(place, last)]), 4), "atMost": place > last}
