"""What all ablations share: variants are trained side by side, and predict the same moments."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.measure.crossing_order import order_results
from experiments.measure.horizon import horizon_results
from experiments.reproduce.stages import run_trainings
from experiments.reproduce.workspace import Workspace
from intersection_env.evaluation.errors import Forecaster, errors
from intersection_env.evaluation.moments import Moment
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor

SHARE = 0.5  # ours: of a driver's epochs, what was not changed included; else the ablations take five hours
NOT_CHANGED = "nothing changed"
CONSTANT_VELOCITY = "constant velocity"
STEADY = Predictor(PolicyFile("critical_gap", "constant_velocity"), CONSTANT_VELOCITY)


def train_variants(
    workspace: Workspace, commands: Mapping[Path, Sequence[str]], epochs: int, share: float = 1.0
) -> None:
    """Trains those that have not been trained.

    Args:
        workspace: whose effort counts.
        commands: run folder to the arguments of `python -m`, without what all trainings are told.
        epochs: of a whole training.
        share: of these, that a variant has.
    """
    wanted = workspace.epochs(round(share * epochs))
    common = ["--epochs", str(wanted), "--resume"]
    trainings = {run: [*command, *common, "--run", str(run)] for run, command in commands.items()}
    run_trainings(trainings, wanted, os.cpu_count() or 1)


def joint_row(forecaster: Forecaster, moments: Sequence[Moment]) -> dict[str, Any]:
    """Errors of both populations, speeds behind the junction, and how often crossing orders are right."""
    name = forecaster.name
    order = order_results([forecaster], moments)["recorded"]["models"][name]
    results = horizon_results({name: errors(forecaster, moments)})
    both = {key: results[key][name] for key in ("at_10s", "until_last_seen")}
    return {"order": order["accuracy"], **both, "speed_behind": results["models"][name]["speed_behind"]}
