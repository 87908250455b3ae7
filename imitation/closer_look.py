"""How a driver in training predicts and drives: what a checkpoint's row says, and the last lines of a training."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from agents.networks.driving import DrivingNetwork
from imitation.replay_error import replay_error
from intersection_env.evaluation.empty_road import empty_road
from intersection_env.evaluation.errors import distance_error, figures_until_last_seen
from intersection_env.evaluation.moments import Moment, followed
from intersection_env.evaluation.places import moments_in
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

STEADY = "constant_velocity"  # beside which predictions are shown
BETWEEN_MOMENTS = 4.0  # [s], of those that are predicted


def watched(places: Sequence[Scenes]) -> list[Moment]:
    """The moments of development from which a driver in training is asked to predict."""
    return followed(moments_in(places, "development", BETWEEN_MOMENTS)[0])


def closer_look(
    driver: DrivingNetwork,
    policy: PolicyFile,
    places: Sequence[Scenes],
    moments: Sequence[Moment],
    within_limits: bool = False,
) -> dict[str, Any]:
    """What a checkpoint's row says: alone in replays, predicting by a policy of this driver, and on an empty road."""
    predictor = Predictor(policy, "in training")
    return {
        "development": dataclasses.asdict(replay_error(driver, places, "development", within_limits=within_limits)),
        "predicted": distance_error(predictor, moments),
        "until_last_seen": figures_until_last_seen(predictor, moments),
        "empty_road": empty_road(predictor, maps=[one.intersection for one in places]).figures(),
    }


def last_look(
    driver: DrivingNetwork, policy: PolicyFile, places: Sequence[Scenes], name: str, within_limits: bool = False
) -> dict[str, Any]:
    """What a trained policy says of itself; printed too, beside constant velocity."""
    alone = dataclasses.asdict(replay_error(driver, places, "development", within_limits=within_limits))
    rounded = {key: None if value is None else round(value, 6) for key, value in alone.items()}
    print(f"alone among the recorded vehicles of development, 10 s: {rounded}")
    predictor, moments = Predictor(policy, name), watched(places)
    until_last_seen = {one.name: figures_until_last_seen(one, moments) for one in (predictor, Predictor.load(STEADY))}
    print(f"until last seen, development [m]: {until_last_seen}")
    free = empty_road(predictor, maps=[one.intersection for one in places])
    print(f"on an empty road, speed as a share of the calibrated IDM's: {free.figures()}; least: {free.where}")
    return {"development": rounded, "until_last_seen": until_last_seen, "empty_road": free.figures()}
