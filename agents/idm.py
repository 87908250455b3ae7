"""Calibrates the IDM: the parameters by which it predicts the recorded vehicles best.

python -m agents.idm --scenes out/scenes.npz --out intersection_env/policies/idm_calibrated.policy
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution
from tqdm import tqdm

from agents.training.folder import file_hash
from intersection_env.policies.file import DT, IdmParameters, PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic
from intersection_env.worlds.life import gap_decider

BOUNDS = {
    "standing_gap": (0.5, 5.0),
    "time_gap": (0.3, 3.0),
    "acceleration": (0.5, 4.0),
    "deceleration": (0.5, 5.0),
    "speed_share": (0.6, 1.2),
    "lateral_acceleration": (0.8, 8.0),
}
"""What is searched, and where; the hardest braking stays as it is."""
HORIZONS = (10, 20, 30, 40, 50)  # steps: 2, 4, ..., 10 s
POPULATION, SEED = 8, 0  # of the search, in units of the number of parameters
ROUNDS = 15  # of the search


@dataclass(frozen=True)
class Moment:
    """One moment to predict from; position: (step, vehicle) recorded; counts: (step, vehicle), scored there."""

    traffic: Traffic
    position: NDArray[np.float32]
    counts: NDArray[np.bool_]


def moments(scenes: Scenes, every: float) -> list[Moment]:
    """One every so many seconds; scored are cars and trucks that are recorded at the start and at the horizon."""
    found: list[Moment] = []
    for scene in scenes:
        for step in range(0, scene.steps - HORIZONS[0], round(every / DT)):
            try:
                traffic = scenes.at(scene, step * DT)
            except ValueError:  # vehicles overlap there
                continue
            position = np.zeros((HORIZONS[-1] + 1, len(traffic)), np.float32)
            counts = np.zeros(position.shape, np.bool_)
            for i, track in enumerate(scene.track(id) for id in traffic.ids):
                part = slice(step - track.start, step - track.start + len(position))
                known = len(track.position[part])
                position[:known, i] = track.position[part]
                counts[:known, i] = track.observed[part] & (track.road_user != "bicycle")
            counts &= counts[0]
            if counts[HORIZONS[0] :].any():
                found.append(Moment(traffic, position, counts))
    return found


def distance_error(predictor: Predictor, asked: Sequence[Moment]) -> float:
    """Of the distance along the route: root of the mean over the horizons of the mean squared errors [m].

    A horizon at which nobody is scored does not count.
    """
    sums, counts = np.zeros(len(HORIZONS)), np.zeros(len(HORIZONS))
    for one in asked:
        predicted = predictor.predict(one.traffic).position[0]
        for h, step in enumerate(HORIZONS):
            error = (predicted[step] - one.position[step])[one.counts[step]]
            sums[h] += float(np.square(error, dtype=np.float64).sum())
            counts[h] += len(error)
    scored = counts > 0
    return float(np.sqrt(np.mean(sums[scored] / counts[scored])))


def calibrate(asked: Sequence[Moment], gap: PolicyFile, rounds: int, progress: bool = True) -> IdmParameters:
    """The best parameters found by differential evolution; `gap` decides about gaps."""

    def error(values: NDArray[np.float64]) -> float:
        parameters = IdmParameters(**dict(zip(BOUNDS, values.tolist(), strict=True)))
        return distance_error(Predictor(dataclasses.replace(gap, driver="idm", idm=parameters), "idm"), asked)

    with tqdm(total=rounds, desc="IDM", unit="round", disable=None if progress else True) as bar:

        def show(intermediate_result: Any) -> None:
            bar.update()
            bar.set_postfix(error=f"{intermediate_result.fun:.2f} m")

        paper = IdmParameters()
        start = [getattr(paper, name) if name != "lateral_acceleration" else BOUNDS[name][1] for name in BOUNDS]
        found = differential_evolution(
            error,
            list(BOUNDS.values()),
            maxiter=rounds,
            popsize=POPULATION,
            x0=start,
            rng=SEED,
            callback=show,
            polish=False,
            tol=0.0,
        )
    return IdmParameters(**dict(zip(BOUNDS, found.x.tolist(), strict=True)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Calibrates on the training scenes and writes the policy file; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m agents.idm", description="Calibrates the IDM.")
    parser.add_argument("--scenes", type=Path, default=Path("out/scenes.npz"), help="the scenes file")
    parser.add_argument("--gap", default="gap", help="who decides about gaps: a policy, critical_gap or sumo")
    parser.add_argument("--every", type=float, default=4.0, help="seconds between the moments predicted from")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="of the search")
    parser.add_argument("--out", type=Path, default=Path("out/idm_calibrated.policy"), help="the policy file to write")
    options = parser.parse_args(arguments)
    begin = time.perf_counter()
    try:
        scenes, gap = Scenes.load(options.scenes), gap_decider(options.gap)
        asked, held_out = (moments(scenes.select(split), options.every) for split in ("train", "development"))
        if not asked or not held_out:
            raise ValueError(f"{options.scenes}: no moment to predict from for training, or none for development")
        print(f"{len(asked)} moments to learn from, {len(held_out)} for development")
        parameters = calibrate(asked, gap, options.rounds)
        policy = dataclasses.replace(gap, driver="idm", idm=parameters)
        figures = {
            name: {
                "train": round(distance_error(Predictor(one, name), asked), 3),
                "development": round(distance_error(Predictor(one, name), held_out), 3),
            }
            for name, one in (("calibrated", policy), ("paper", dataclasses.replace(policy, idm=IdmParameters())))
        }
        about = {
            "made_by": "python -m agents.idm",
            "settings": {"every": options.every, "rounds": options.rounds, "gap": options.gap},
            "data": {"map": scenes.intersection.name, "sha256": file_hash(options.scenes)},
            "distance_error": figures,
        }
        dataclasses.replace(policy, about=about).save(options.out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{parameters}\nroot of the mean squared error over 2 to 10 s [m]: {figures}")
    print(f"written: {options.out}, in {time.perf_counter() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
