"""Which of the trained policies is the default: the one that predicts best of those that pass the gates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from intersection_env.evaluation.errors import figures_until_last_seen
from intersection_env.evaluation.gates import gates
from intersection_env.evaluation.moments import Moment
from intersection_env.prediction.predictor import Predictor


def default_of(policies: Sequence[Predictor], moments: Sequence[Moment], reference: Predictor) -> dict[str, Any]:
    """The choice, and what it was made by.

    Args:
        policies: those to choose from.
        moments: of development.
        reference: whose speed is wanted on an empty road.

    Returns:
        "default", a name: the lowest RMSE until last seen of those that pass the gates. Under "policies", by name,
        "until_last_seen", as of `figures_until_last_seen`; "empty_road", least share of the reference's speed;
        "disobeys", how often; "collisions", share of predictions; and "refusals", in words. Under
        "constant_velocity" its errors until last seen.

    Raises:
        ValueError: no policy passes the gates; or there is nobody to score.
    """
    rows: dict[str, Any] = {}
    for one in policies:
        found = gates(one, moments, reference)
        rows[one.name] = {
            "until_last_seen": figures_until_last_seen(one, moments),
            "empty_road": found.empty_road.least,
            "disobeys": len(found.obedience.wrong),
            "collisions": found.collisions,
            "refusals": found.refusals(),
        }
    passing = {name: row["until_last_seen"]["rmse"] for name, row in rows.items() if not row["refusals"]}
    if not passing:
        said = "; ".join(f"{name}: {', '.join(row['refusals'])}" for name, row in rows.items())
        raise ValueError(f"no policy passes the gates, so none can be the default: {said}")
    constant = figures_until_last_seen(Predictor.load("constant_velocity"), moments)
    return {"default": min(passing, key=passing.__getitem__), "policies": rows, "constant_velocity": constant}
