"""How often instruction sets decide differently about the same gap; a part of `make bench`.

They round differently, and where a rounding error decides, the futures part: what flips afterwards counts too.
"""

from __future__ import annotations

from itertools import islice

import numpy as np
from numpy.typing import NDArray

from experiments.bench.timed_traffic import random_traffics
from intersection_env import Predictor, Traffic, _core

POLICY = "gap"


def flip_rates(traffics: int) -> dict[str, dict[str, float]]:
    """Each instruction set beside the best one, without intervention, by "one-other"; prints it.

    `decisions`: the share of (vehicle, step) whose gap decision differs; `traffics`: of how many it was taken;
    `scenarios`: the share of traffics in which any decision differs; `position_m`: the largest distance [m] between
    positions where both replay the decisions of the best one.
    """
    *others, best = _core.available_kernels()
    found = {f"{isa}-{best}": _rates(isa, best, traffics) for isa in reversed(others)}
    for name, row in found.items():
        print(
            f"{name}: {100 * row['decisions']:.4f} % of the decisions differ, {100 * row['scenarios']:.2f} % of the"
            f" {traffics} traffics; replayed, positions by at most {1e3 * row['position_m']:.2g} mm"
        )
    return found


def _rates(isa: str, best: str, traffics: int) -> dict[str, float]:
    decisions, scenarios, distance = [], [], 0.0
    policy = Predictor.load(POLICY)
    for scene in islice(random_traffics(), traffics):
        predictor = policy.bound_to(scene.intersection)
        position, enters = _predicted(predictor, scene, best)
        _, otherwise = _predicted(predictor, scene, isa)
        decisions.append((enters != otherwise).mean())
        scenarios.append((enters != otherwise).any())
        replayed, _ = _predicted(predictor, scene, isa, enters)
        distance = max(distance, float(np.abs(position - replayed).max()))
    return {
        "traffics": traffics,
        "decisions": float(np.mean(decisions)),
        "scenarios": float(np.mean(scenarios)),
        "position_m": distance,
    }


def _predicted(
    predictor: _core.Predictor, scene: Traffic, isa: str, decisions: NDArray[np.uint8] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Positions (1, time, vehicle) [m] and gap decisions (1, step, vehicle), without intervention; or with decisions
    made before."""
    none = np.zeros((1, len(scene.conflicts)), np.int8)
    position, _, _, enters, *_ = predictor.predict(scene.core, none, True, False, decisions, isa)
    return position, np.ascontiguousarray(enters[:, : _core.STEPS])
