"""What each part of the rollout gradient is worth, and how its driver predicts at a place that it does not know."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network
from experiments.measure.horizon import horizon_results
from experiments.reproduce.simulated_scenes import wider_scenes
from experiments.reproduce.variants import CONSTANT_VELOCITY, NOT_CHANGED, SHARE, STEADY, joint_row, train_variants
from experiments.reproduce.workspace import Workspace
from imitation.replay_error import constant_velocity_network, replay_error
from imitation.rollout_gradient import PROFILES
from intersection_env.evaluation.empty_road import empty_road
from intersection_env.evaluation.errors import UNTIL_LAST_SEEN, errors
from intersection_env.evaluation.moments import Moment, moments_of
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor

ROLLOUTS = {
    NOT_CHANGED: [],
    "alone only, no joint rollouts": ["--alone-share", "1.0"],
    "jointly from the first epoch on": ["--alone-share", "0"],
    "joint predictions count three times as much": ["--joint-weight", "3"],
    "the gap network does not learn": ["--no-learns-gaps"],
    "alone for 5 s instead of 10 s": ["--steps", "25"],
    "a start every 4 s of each place": ["--every", "12"],
    "limits as the maps say": ["--limits", "1", "--every", "1"],
    "no speed term": ["--speed-weight", "0"],
    "noise on inputs": ["--noise", "0.1"],
    "no free drives": ["--free-share", "0"],
    "positions beyond 1 m count linearly": ["--huber", "1"],
    "beyond 3 m for the gap network too": ["--gap-huber", "3"],
}
"""Options of `imitation.rollout_gradient`, where they are not the default ones."""
DEFAULT_ROLLOUTS = "rollout gradient, all epochs"
WIDER = "drivers drawn more widely"
NO_LARGER = "no larger places"
LEFT_OUT, EVERYWHERE = "left_out", "everywhere"


class RolloutVariants:
    """Trainings with one thing changed, or without one of the places."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        run_of, seeds = workspace.run_of, workspace.options.seeds
        several = [place.name for place in workspace.places] if len(workspace.places) > 1 else []
        self.of_options = {name: run_of(f"ablation_rollouts_{number}") for number, name in enumerate(ROLLOUTS)}
        self.of_one = {name: run_of(f"ablation_rollouts_only_{name}") for name in several[:1]}
        self.of_others = {name: run_of(f"ablation_rollouts_without_{name}") for name in several}
        others = {WIDER: run_of("ablation_rollouts_wider"), NO_LARGER: run_of("ablation_rollouts_no_larger")}
        self.of_scenes = others if workspace.simulated else {}
        self.unchanged = {seed: run_of(f"rollout_gradient_{seed}") for seed in seeds}

    def train(self) -> None:
        """Those that have not been trained, with the first seed."""
        places = self.workspace.places
        commands = {run: self._command(places, ROLLOUTS[name]) for name, run in self.of_options.items()}
        for name, run in self.of_one.items():
            commands[run] = self._command([place for place in places if place.name == name])
        for name, run in self.of_others.items():
            commands[run] = self._command([place for place in places if place.name != name])
        if self.of_scenes:
            files = wider_scenes(places, self.workspace.options.work / "wider")
            commands[self.of_scenes[WIDER]] = self._command(places, told=self.workspace.learned_from(places, files))
            commands[self.of_scenes[NO_LARGER]] = self._command(places, told=self.workspace.arguments(places))
        train_variants(self.workspace, commands, PROFILES["default"][1].epochs, SHARE)

    def _command(
        self, places: Sequence[Intersection], changed: Sequence[str] = (), told: Sequence[str] = ()
    ) -> list[str]:
        """told: of which scenes; what all learn from, unless it is given."""
        workspace = self.workspace
        gap, idm = (str(workspace.policy(name)) for name in ("gap", "idm_calibrated"))
        scenes = told or workspace.learned_from(places)
        common = ["imitation.rollout_gradient", "default", *scenes, "--decider", gap]
        return [*common, "--teacher", idm, "--seed", str(workspace.options.seeds[0]), *changed]

    def rows(self, moments: Sequence[Moment]) -> dict[str, Any]:
        """Per variant: alone among recorded vehicles within a prediction's limits, on an empty road, predicting all."""
        runs = {f"{DEFAULT_ROLLOUTS}, seed {seed}": run for seed, run in self.unchanged.items()} | self.of_options
        runs |= self.of_scenes
        runs |= {f"one place only: {name}": run for name, run in self.of_one.items()}
        found = {CONSTANT_VELOCITY: self._row(constant_velocity_network(), STEADY, moments)}
        for name, run in runs.items():
            policy = _policy(run)
            found[name] = self._row(driving_network(policy), Predictor(policy, name), moments)
        return found

    def _row(self, network: DrivingNetwork, predictor: Predictor, moments: Sequence[Moment]) -> dict[str, Any]:
        alone = replay_error(network, self.workspace.scenes, "development", within_limits=True)
        least = empty_road(predictor, maps=self.workspace.places).least
        return {"alone": dataclasses.asdict(alone), "empty_road": least, **joint_row(predictor, moments)}

    def left_out(self) -> dict[str, Any]:
        """Per place: errors there until last seen, of who did not learn from it and of who learned from all places."""
        found = {}
        for place in self.workspace.all_scenes():
            name = place.intersection.name
            if name in self.of_others:
                moments, _ = moments_of(place.select("development"))
                policies = {LEFT_OUT: _policy(self.of_others[name]), EVERYWHERE: _policy(self.of_options[NOT_CHANGED])}
                both = {one: errors(Predictor(policy, one), moments) for one, policy in policies.items()}
                found[name] = horizon_results(both, (EVERYWHERE,))[UNTIL_LAST_SEEN]
        return found


def _policy(run: Path) -> PolicyFile:
    return PolicyFile.read(run / "rollout_gradient.policy")
