"""What each part is worth: trainings with one thing changed, measured on the development recordings.

python -m experiments.reproduce.ablations        (`make ablations`; goes on from the trainings of `make reproduce`)
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
import tyro

from agents.gap.train import PROFILES as GAP_PROFILES
from agents.networks.export import driving_network
from agents.training.folder import METRICS
from experiments.models.lead_across import AcrossPredictor, TorchForecaster
from experiments.reproduce.rollout_variants import ROLLOUTS, RolloutVariants
from experiments.reproduce.stages import exit_status_of
from experiments.reproduce.trainings import Trainings
from experiments.reproduce.variants import CONSTANT_VELOCITY, NOT_CHANGED, SHARE, STEADY, joint_row, train_variants
from experiments.reproduce.workspace import Options, Workspace
from experiments.results_files import write_result
from experiments.show.ablations import LEAD_MOMENTS, ablation_tables
from imitation.gail import PROFILES as GAIL_PROFILES
from imitation.replay_error import constant_velocity_network, replay_error
from imitation.torch_model import TorchPredictor
from intersection_env.command import run_command
from intersection_env.evaluation.errors import Forecaster
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

GAP = {
    "no input noise": ["--noise", "0"],
    "the paper's input noise": ["--noise", "1"],
}
"""Options of `agents.gap.train`, where they are not the default ones."""
GAIL = {
    NOT_CHANGED: [],
    "ends of tracks bootstrapped": ["--bootstrap-ends"],
    "PPO's policy not kept on an empty road": ["--kept", "0"],
    "no cloning, nor PPO's policy kept": ["--cloning", "0"],
    "the discriminator learns from all steps at once": ["--discriminator.minibatches", "1"],
    "gradient penalty 1 instead of 0.01": ["--discriminator.gradient-penalty", "1"],
    "no gradient penalty": ["--discriminator.gradient-penalty", "0"],
    "no smoothed labels, no noise on inputs": ["--discriminator.smoothing", "0", "--discriminator.noise", "0"],
    "noise of actions does not fall": ["--last-sigma", str(GAIL_PROFILES["default"][1].sigma)],
    "10 updates of the policy an epoch, as in the paper": ["--update.passes", "10", "--update.minibatches", "1"],
    "delta from the gap network": ["--gap", "{gap}"],
    "from random networks, without PPO": ["--ppo", "None"],
    "from the rollout gradient's driver": ["--policy", "{rollouts}"],
}
"""Options of `imitation.gail`, where they are not the default ones; {gap} and {rollouts} are policy files."""
DEFAULT_GAP, DEFAULT_GAIL = "gap network, nothing changed", "GAIL, all epochs"
IN_CORE, IN_TORCH, ACROSS = "in one's own lane", "the same, as plain torch operations", "who stands across the path too"


class Ablations:
    """The stages of the ablations."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.options = workspace.options
        self.output = workspace.options.out / "ablations.json"

    def run(self) -> None:
        """Trains each variant that has not been trained, and measures all."""
        inputs = {
            "changes": {"gap": GAP, "gail": GAIL, "rollout_gradient": ROLLOUTS},
            "effort": self.options.effort,
            "seeds": list(self.options.seeds),
        }
        self.workspace.stage("ablations", ["default"], self.output, self._all, **inputs)

    def _all(self) -> None:
        gap, gail, rollouts = self._trained_gaps(), self._trained_drivers(), RolloutVariants(self.workspace)
        rollouts.train()
        content = {
            "gap": self._gaps(gap),
            "gail": self._drivers(gail),
            "rollout_gradient": rollouts.rows(self._moments),
            "left_out": rollouts.left_out(),
            "lead": self._leads(),
        }
        write_result(self.output, content)

    def _trained_gaps(self) -> dict[str, Path]:
        """The run of each gap network, the one with nothing changed first."""
        runs = {name: self.workspace.run_of(f"ablation_gap_{place}") for place, name in enumerate(GAP)}
        common = ["agents.gap", "default", *self.workspace.arguments(self.workspace.places)]
        commands = {runs[name]: [*common, *changed] for name, changed in GAP.items()}
        train_variants(self.workspace, commands, GAP_PROFILES["default"][1].epochs)
        return {DEFAULT_GAP: self.workspace.run_of("gap")} | runs

    def _trained_drivers(self) -> dict[str, Path]:
        """The run of each driver, those with nothing changed first, with every seed."""
        runs = {name: self.workspace.run_of(f"ablation_gail_{place}") for place, name in enumerate(GAIL)}
        gap, (seed, *_) = str(self.workspace.policy("gap")), self.options.seeds
        rollouts = str(self._driver_by_rollouts)
        common = ["imitation.gail", "default", *self.workspace.arguments(self.workspace.places)]
        common += ["--decider", gap, "--seed", str(seed)]
        start = ["--ppo", str(self.workspace.run_of(f"ppo_{seed}"))]
        commands = {}
        for name, changed in GAIL.items():
            from_ppo = [] if "--ppo" in changed else start
            commands[runs[name]] = [
                *common,
                *from_ppo,
                *(one.format(gap=gap, rollouts=rollouts) for one in changed),
                "--threads",
                "1",
            ]
        train_variants(self.workspace, commands, GAIL_PROFILES["default"][1].epochs, SHARE)
        unchanged = {f"{DEFAULT_GAIL}, seed {one}": self.workspace.run_of(f"gail_{one}") for one in self.options.seeds}
        return unchanged | runs

    def _gaps(self, runs: Mapping[str, Path]) -> dict[str, Any]:
        """Per variant: how often frames are decided rightly, and what comes of it with the calibrated IDM."""
        idm = PolicyFile.read(self.workspace.policy("idm_calibrated"))
        found = {CONSTANT_VELOCITY: {"frames": None, **joint_row(STEADY, self._moments)}}
        for name, run in runs.items():
            policy = PolicyFile.read(run / "gap.policy")
            frames = policy.about["development"]
            predictor = Predictor(dataclasses.replace(idm, gap_network=policy.gap_network), name)
            found[name] = {
                "frames": {foes: row["accuracy"] for foes, row in frames.items()},
                **joint_row(predictor, self._moments),
            }
        return found

    def _drivers(self, runs: Mapping[str, Path]) -> dict[str, Any]:
        """Per variant: driving alone among recorded vehicles, predicting all, and how steadily that was learned.

        All are measured with the checkpoint that predicted best, so `last` [m] says what choosing it was worth: the
        error of the last one, beside the `best`, as the training saw them (`distance_error`).
        """
        start = self.workspace.run_of(f"ppo_{self.options.seeds[0]}")
        policies = {"PPO alone, without GAIL": start / "ppo.policy"}
        policies |= {"the rollout gradient's driver, without GAIL": self._driver_by_rollouts}
        policies |= {name: run / "gail.policy" for name, run in runs.items()}
        steady = replay_error(constant_velocity_network(), self._scenes, "development")
        found = {
            CONSTANT_VELOCITY: {
                "alone": dataclasses.asdict(steady),
                "checkpoints": None,
                **joint_row(STEADY, self._moments),
            }
        }
        for name, path in policies.items():
            policy = PolicyFile.read(path)
            alone = replay_error(driving_network(policy), self._scenes, "development")
            predicted = _predicted(path.parent / METRICS)
            checkpoints = {"best": min(predicted), "last": predicted[-1]} if predicted else None
            found[name] = {
                "alone": dataclasses.asdict(alone),
                "checkpoints": checkpoints,
                **joint_row(Predictor(policy, name), self._moments),
            }
        return found

    def _leads(self) -> dict[str, Any]:
        """With whom to follow changed, in predictions; no driver has been trained with it."""
        policy = PolicyFile.read(self.workspace.policy("gail"))
        forecasters: tuple[Forecaster, ...] = (
            STEADY,
            Predictor(policy, IN_CORE),
            TorchForecaster(IN_TORCH, policy, TorchPredictor),
            TorchForecaster(ACROSS, policy, AcrossPredictor),
        )
        moments = thinned(contested(self._moments), LEAD_MOMENTS)  # torch operations are slow
        return {one.name: joint_row(one, moments) for one in forecasters}

    @property
    def _driver_by_rollouts(self) -> Path:
        return self.workspace.run_of(f"rollout_gradient_{self.options.seeds[0]}") / "rollout_gradient.policy"

    @cached_property
    def _scenes(self) -> Scenes:
        return self.workspace.scenes

    @cached_property
    def _moments(self) -> list[Moment]:
        return moments_of(self._scenes.select("development"))[0]


def _predicted(metrics: Path) -> list[float]:
    """The error of the prediction at each checkpoint of a training [m]; none, if it did not look."""
    rows = map(json.loads, metrics.read_text(encoding="utf-8").splitlines())
    return [row["predicted"] for row in rows if "predicted" in row]


def ablate(options: Options) -> None:
    """Does what is not done yet, and prints the tables.

    Raises:
        StageFailedError, ValueError, OSError: as of `Trainings.run`.
    """
    workspace = Workspace(options)
    Trainings(workspace).run()
    Ablations(workspace).run()
    print(ablation_tables(json.loads((options.out / "ablations.json").read_text(encoding="utf-8"))))


def main(options: Options) -> int:
    """Does what is not done yet; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    return exit_status_of(lambda: ablate(options))


if __name__ == "__main__":
    run_command(lambda: main(tyro.cli(Options, prog="python -m experiments.reproduce.ablations", description=__doc__)))
