"""Calibrates the IDM: the parameters by which it predicts the recorded vehicles best, those who drive off included.

python -m agents.idm --out out/idm_calibrated.policy                        on all places that ship
python -m agents.idm --scenes mine.npz --map mine.json --out mine.policy    on one's own
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution
from tqdm import tqdm

from agents.training.command import Command
from agents.training.folder import file_hash
from intersection_env.command import run_command
from intersection_env.evaluation.errors import distance_error, figures_until_last_seen
from intersection_env.evaluation.moments import Moment, followed
from intersection_env.evaluation.places import moments_in
from intersection_env.files import check_writable
from intersection_env.policies.file import IdmParameters, PolicyFile
from intersection_env.policies.named import gap_decider
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import ALL_SCENES, load_places, map_names
from intersection_env.scenes.scenes import scenes_path

COMMAND = "python -m agents.idm"
BOUNDS = {
    "standing_gap": (0.5, 5.0),
    "time_gap": (0.3, 3.0),
    "acceleration": (0.5, 4.0),
    "deceleration": (0.5, 5.0),
    "speed_share": (0.6, 1.2),
    "lateral_acceleration": (0.8, 8.0),
}
"""What is searched, and where; the hardest braking stays as it is."""
POPULATION, SEED = 8, 0  # of the search, in units of the number of parameters
ROUNDS = 15  # of the search


def calibrate(moments: Sequence[Moment], gap: PolicyFile, rounds: int, progress: bool = True) -> IdmParameters:
    """The best parameters found by differential evolution; `gap` decides about gaps."""

    def error(values: NDArray[np.float64]) -> float:
        parameters = IdmParameters(**dict(zip(BOUNDS, values.tolist(), strict=True)))
        return distance_error(Predictor(dataclasses.replace(gap, driver="idm", idm=parameters), "idm"), moments)

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
    parser = argparse.ArgumentParser(prog=COMMAND, description="Calibrates the IDM.")
    parser.add_argument(
        "--scenes", type=Path, nargs="+", default=ALL_SCENES, help="scenes that ship (names), or scenes files"
    )
    parser.add_argument("--map", nargs="+", default=(), help="the maps (files) of scenes on maps that do not ship")
    parser.add_argument("--gap", default="gap", help="who decides about gaps: a policy, critical_gap or sumo")
    parser.add_argument("--every", type=float, default=4.0, help="seconds between the moments predicted from")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="of the search")
    parser.add_argument("--out", type=Path, default=Path("out/idm_calibrated.policy"), help="the policy file to write")
    options = parser.parse_args(arguments)
    with Command(options.out) as command:
        check_writable(options.out)
        places, gap = load_places(options.scenes, options.map), gap_decider(options.gap)
        moments, held_out = (
            followed(moments_in(places, split, options.every)[0]) for split in ("train", "development")
        )
        if not moments or not held_out:
            names = ", ".join(map(str, options.scenes))
            raise ValueError(f"{names}: no moment to predict from for training, or none for development")
        print(f"{len(moments)} moments to learn from, {len(held_out)} for development")
        parameters = calibrate(moments, gap, options.rounds)
        policy = dataclasses.replace(gap, driver="idm", idm=parameters)
        figures = {
            name: {
                "train": round(distance_error(Predictor(one, name), moments), 3),
                "development": round(distance_error(Predictor(one, name), held_out), 3),
            }
            for name, one in (("calibrated", policy), ("paper", dataclasses.replace(policy, idm=IdmParameters())))
        }
        print(f"{parameters}\nroot of the mean squared error over 2 to 10 s, when last seen until then [m]: {figures}")
        until_last_seen = {
            one.name: figures_until_last_seen(one, held_out)
            for one in (Predictor(policy, "calibrated"), Predictor.load("constant_velocity"))
        }
        print(f"until last seen, development [m]: {until_last_seen}")
        about = {
            "made_by": COMMAND,
            "settings": {"every": options.every, "rounds": options.rounds, "gap": options.gap},
            "data": {
                "maps": map_names(places),
                "sha256": [file_hash(scenes_path(name)) for name in options.scenes],
            },
            "distance_error": figures,
            "until_last_seen": until_last_seen,
        }
        dataclasses.replace(policy, about=about).save(command.output)
    return command.status


if __name__ == "__main__":
    run_command(main)
