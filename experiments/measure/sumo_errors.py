"""How far SUMO as it comes is off as a predictor, beside the calibrated IDM and constant velocity.

Errors to read, without a results file.

python -m experiments.sumo_predictor
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from agents.training.options import Maps
from experiments.measure.recorded import places_of
from experiments.models.sumo_predictor import predictions
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.places import moments_in
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES


@dataclass(frozen=True)
class Options:
    """SUMO as it comes, as a predictor."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    split: Literal["train", "development", "validation"] = "development"
    """What to measure on."""


def main(options: Options) -> int:
    """Prints the errors; returns the exit status."""
    try:
        moments, _ = moments_in(places_of(options.scenes, options.map, options.split), options.split)
        begin = time.perf_counter()
        sumo = predictions([one.traffic for one in moments])
    except (OSError, ValueError, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{len(moments)} moments, {(time.perf_counter() - begin) / len(moments) * 1e3:.1f} ms each by SUMO")
    for one in (sumo, Predictor.load("idm_calibrated"), Predictor.load("constant_velocity")):
        print(evaluate(one, moments).round(2).to_string(index=False))
    return 0
