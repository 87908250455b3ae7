"""The next 10 s of a traffic as the page plays them: one prediction, its fans, and who waits for whom."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.prediction.forecast import Forecast, forecast
from intersection_env.prediction.measures import crossing_order
from intersection_env.prediction.predictor import Prediction, Predictor
from intersection_env.traffic import Traffic
from intersection_env.viewer.asked import Asked, doubts
from intersection_env.viewer.recorded import label
from intersection_env.viewer.road import rounded

LEVELS = (0.1, 0.9)
"""Of the fans: they hold 80 % of the probability."""
MOST = 16  # ours: orders that are predicted for the fans; the further ones weigh little, and take time


def predicted(predictor: Predictor, asked: Asked) -> dict[str, Any]:
    """What happens if what is assigned is done: of all orders then, the most probable one is shown.

    A policy without an order network leaves to the gap decision what is not assigned, and has no fans.
    """
    traffic = asked.traffic
    given = asked.priorities
    likely = forecast(predictor, traffic, given, most=MOST) if predictor.core_policy.can_forecast else None
    shown = predictor.predict(traffic, given) if likely is None else likely.most_probable()
    order = crossing_order(traffic, shown)[0]
    with doubts():  # what is to be doubted later follows from what is now
        waits = list(_waits(shown, order))
    return {
        "vehicles": [_vehicle(traffic, i) for i in range(len(traffic))],
        "position": rounded(shown.position[0].T),
        "speed": rounded(shown.speed[0].T),
        "steps": shown.present[0].sum(axis=0).tolist(),
        "held": [[int(step) for step in np.flatnonzero(~enters)] for enters in shown.enters[0].T],
        "waits": waits,
        "fans": None if likely is None else _fans(likely),
        "probability": None if likely is None else round(float(likely.probability[0]), 4),
        "pairs": _pairs(traffic, given, order, likely),
        "timeLoss": rounded(shown.time_loss[0]),
        "minimumDistance": round(float(distance), 2) if np.isfinite(distance := shown.minimum_distance[0]) else None,
        "overlaps": [list(pair) for pair in traffic.overlaps],
        "notes": list(asked.notes),
    }


def _vehicle(traffic: Traffic, index: int) -> dict[str, Any]:
    own = {name: round(float(getattr(traffic, name)[index]), 3) for name in ("position", "speed", "length", "width")}
    top = float(traffic.max_speed[index])
    return {
        "id": traffic.ids[index],
        "label": label(traffic.ids[index]),
        "route": traffic.intersection.routes[traffic.route[index]].id,
        **own,
        "maxSpeed": round(top, 3) if np.isfinite(top) else None,
    }


def _fans(likely: Forecast) -> dict[str, Any]:
    low, high = likely.position_quantiles(LEVELS)
    return {"levels": list(LEVELS), "low": rounded(low.T), "high": rounded(high.T)}


def _pairs(
    traffic: Traffic, given: NDArray[np.int8], order: NDArray[np.int8], likely: Forecast | None
) -> list[dict[str, Any]]:
    """Each open conflict: who yields by rule, who goes first here (+1: who yields), and what is assigned."""
    return [
        {
            "yielder": int(yielder),
            "prioritized": int(prioritized),
            "first": int(order[k]),
            "given": int(given[k]),
            "yielderFirst": None if likely is None else round(float(likely.yielder_first[k]), 4),
        }
        for k, (yielder, prioritized) in enumerate(traffic.conflicts)
    ]


def _waits(shown: Prediction, order: NDArray[np.int8]) -> Iterator[list[list[int]]]:
    """At each step who is held, and by whom: (waiting, awaited), of pairs still open in which the other goes first.

    Where neither goes within the horizon it is as the rule says, or as it was asked for.
    """
    start = shown.traffic
    asked = np.zeros_like(order) if shown.priorities is None else shown.priorities[0]
    first = np.where(order != 0, order, np.where(asked != 0, asked, -1))
    awaited: dict[tuple[str, str], list[list[int]]] = {}
    for (yielder, prioritized), way in zip(start.conflicts.tolist(), first.tolist(), strict=True):
        pairs = awaited.setdefault((start.ids[yielder], start.ids[prioritized]), [])
        pairs.append([yielder, prioritized][::-way])
    for step, time in enumerate(shown.time):
        held = ~shown.enters[0, step]
        if not (held & shown.present[0, step]).any():
            yield []
            continue
        now = shown.traffic_at(float(time))
        found = [pair for a, b in now.conflicts for pair in awaited[now.ids[a], now.ids[b]] if held[pair[0]]]
        yield [list(pair) for pair in dict.fromkeys(map(tuple, found))]
