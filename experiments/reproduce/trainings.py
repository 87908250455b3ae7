"""The trainings of `make reproduce`: scenes, gap network, calibrated IDM and the drivers; and which is the default."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from agents.gap.train import PROFILES as GAP_PROFILES
from agents.idm import ROUNDS
from agents.networks.export import order_network
from agents.orders.train import PROFILES as ORDER_PROFILES
from agents.orders.train import with_forecast
from agents.ppo import PROFILES as PPO_PROFILES
from agents.training.folder import file_hash
from data.build import build
from data.build import summary as scenes_summary
from experiments.reproduce.default import default_of
from experiments.reproduce.simulated_scenes import LARGER, OF_LARGER
from experiments.reproduce.stages import run_module, run_trainings
from experiments.reproduce.workspace import Workspace
from experiments.results_files import write_result
from imitation.closer_look import watched
from imitation.gail import PROFILES as GAIL_PROFILES
from imitation.rollout_gradient import PROFILES as ROLLOUT_PROFILES
from intersection_env.evaluation.empty_road import empty_road
from intersection_env.evaluation.errors import distance_error
from intersection_env.evaluation.gates import LEAST_MEAN_SPEED, LEAST_SPEED, MOST_COLLISIONS
from intersection_env.evaluation.moments import followed, moments_of
from intersection_env.evaluation.places import moments_in
from intersection_env.files import written_whole
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scene import SPLITS

TRAINED = ("gap", "idm_calibrated", "rollout_gradient", "ppo", "gail")
"""Policies that ship."""


class Trainings:
    """The stages that learn, each from what came before."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.options = workspace.options

    def run(self) -> None:
        """Scenes, gap network, calibrated IDM, drivers, the default; of each driver one a seed, and then the best.

        Raises:
            StageFailedError: a training ended with an error.
            ValueError: of the map, or of the recordings; before anything is trained.
            OSError: a file cannot be read or written.
        """
        workspace, options, seeds = self.workspace, self.options, list(self.options.seeds)
        print(f"recordings of {options.recordings} on maps: {', '.join(one.name for one in workspace.places)}")
        hashes = {path.name: file_hash(path) for path in sorted(options.recordings.glob("*")) if path.is_file()}
        stage, policy, effort = workspace.stage, workspace.policy, options.effort
        for name, place in zip(workspace.scenes_stages(), workspace.places, strict=True):
            out = workspace.scenes_of(place)
            stage(name, [], out, partial(self._scenes, place), recordings=hashes, map=place.checksum)
        order = workspace.scenes_stages()
        stage("gap", order, policy("gap"), self._gap, effort=effort, order=order)
        stage("idm", ["gap"], policy("idm_calibrated"), self._idm, effort=effort)
        needed, rollouts = ["gap", "idm"], policy("rollout_gradient")
        if workspace.simulated:
            how = {"times": LARGER, "recordings": OF_LARGER}
            stage("larger", order, workspace.larger_made, self._larger, **how)
            needed.append("larger")
        stage("rollout_gradient", needed, rollouts, self._rollout_gradient, seeds=seeds, effort=effort)
        stage("ppo", ["gap"], policy("ppo"), self._ppo, seeds=seeds, effort=effort)
        stage("gail", ["ppo", "idm"], policy("gail"), self._gail, effort=effort)
        makers = ["gap", "idm", "rollout_gradient", "ppo", "gail"]
        stage("forecasts", makers, workspace.forecasting("orders"), self._forecasts, effort=effort)
        drivers, limits = ["rollout_gradient", "gail"], [LEAST_SPEED, LEAST_MEAN_SPEED, MOST_COLLISIONS]
        stage("default", ["idm", *drivers, "forecasts"], self.workspace.default, self._default, limits=limits)

    def _scenes(self, place: Intersection) -> None:
        scenes = build(self.options.recordings, place)
        print(scenes_summary(scenes))
        for split in SPLITS:
            if not moments_of(scenes.select(split))[0]:
                raise ValueError(f'{self.options.recordings}: no scene for split "{split}" with vehicles to predict')
        scenes.save(self.workspace.scenes_of(place))

    def _gap(self) -> None:
        run, epochs = self.workspace.run_of("gap"), self.workspace.epochs(GAP_PROFILES["default"][1].epochs)
        run_module("agents.gap", "default", *self._everywhere, "--run", str(run), "--epochs", str(epochs), "--resume")
        self._keep(run / "gap.policy", "gap")

    def _idm(self) -> None:
        arguments = [*self._everywhere, "--gap", str(self.workspace.policy("gap"))]
        arguments += ["--rounds", str(self.workspace.epochs(ROUNDS))]
        arguments += ["--out", str(self.workspace.policy("idm_calibrated"))]
        run_module("agents.idm", *arguments)

    def _larger(self) -> None:
        made = self.workspace.larger_made
        if made.parent.exists():  # of other maps, or other sizes: what is there is not made again
            shutil.rmtree(made.parent)
        files = self.workspace.larger(self.workspace.places)
        write_result(made, {one.name: file_hash(one) for pair in files for one in pair})

    def _rollout_gradient(self) -> None:
        decider, teacher = (str(self.workspace.policy(name)) for name in ("gap", "idm_calibrated"))
        arguments = [*self.workspace.learned_from(self.workspace.places), "--decider", decider, "--teacher", teacher]
        epochs = ROLLOUT_PROFILES["default"][1].epochs
        command = ["imitation.rollout_gradient", "default", *arguments]
        self._seeds("rollout_gradient", epochs, lambda seed: command, has_threads=False)
        self._predicting_best("rollout_gradient")

    def _ppo(self) -> None:
        arguments = ["--map", *self.workspace.maps(), "--gaps", str(self.workspace.policy("gap")), "critical_gap"]
        self._seeds("ppo", PPO_PROFILES["fast"][1].epochs, lambda seed: ["agents.ppo", "fast", *arguments])

        def reward(path: Path) -> float:
            runs = PolicyFile.read(path).about["validation_run"].values()
            return float(sum(run["reward"] for of_map in runs for run in of_map.values()))

        self._best("ppo", reward)

    def _gail(self) -> None:
        arguments = [*self._everywhere, "--decider", str(self.workspace.policy("gap"))]

        def command(seed: int) -> list[str]:
            return ["imitation.gail", "default", *arguments, "--ppo", str(self.workspace.run_of(f"ppo_{seed}"))]

        self._seeds("gail", GAIL_PROFILES["default"][1].epochs, command)
        self._predicting_best("gail")

    def _forecasts(self) -> None:
        """The order network, and each policy with it and with the spread of its own drivers."""
        run, epochs = self.workspace.run_of("orders"), self.workspace.epochs(ORDER_PROFILES["default"][1].epochs)
        arguments = [*self._everywhere, "--policy", str(self.workspace.policy("idm_calibrated"))]
        run_module("agents.orders", "default", *arguments, "--run", str(run), "--epochs", str(epochs), "--resume")
        learned, places = PolicyFile.read(run / "orders.policy"), self.workspace.all_scenes()
        for name in TRAINED:
            plain, out = PolicyFile.read(self.workspace.policy(name)), self.workspace.forecasting(name)
            with_forecast(plain, order_network(learned), places, learned.about["orders"]).save(out)
        _copy(run / "orders.policy", self.workspace.forecasting("orders"))

    def _default(self) -> None:
        policies = [Predictor.load(self.workspace.policy(name)) for name in TRAINED]
        moments = followed(moments_in(self.workspace.all_scenes(), "development")[0])
        reference = Predictor.load(self.workspace.policy("idm_calibrated"))
        found = default_of(policies, moments, reference)
        print(f"default: {found['default']}")
        write_result(self.workspace.default, found)

    @property
    def _everywhere(self) -> list[str]:
        return self.workspace.arguments(self.workspace.places)

    def _seeds(self, name: str, epochs: int, command: Callable[[int], list[str]], has_threads: bool = True) -> None:
        """Trains a driver with each seed, as many at a time as there are cores; who has threads shares them."""
        cores, wanted = os.cpu_count() or 1, self.workspace.epochs(epochs)
        at_once = min(cores, len(self.options.seeds))
        trainings = {}
        for seed in self.options.seeds:
            run = self.workspace.run_of(f"{name}_{seed}")
            arguments = ["--seed", str(seed), "--run", str(run), "--epochs", str(wanted), "--resume"]
            threads = ["--threads", str(cores // at_once)] if has_threads else []
            trainings[run] = [*command(seed), *arguments, *threads]
        run_trainings(trainings, wanted, at_once)
        for run in trainings:
            self._keep(run / f"{name}.policy", run.name)

    def _predicting_best(self, name: str) -> None:
        seen = watched(self.workspace.all_scenes())
        reference = Predictor.load(self.workspace.policy("idm_calibrated"))

        def merit(path: Path) -> tuple[bool, float]:
            """Whoever crawls on an empty road is chosen only if all do."""
            driver = Predictor.load(path)
            alone = empty_road(driver, reference, self.workspace.places)
            return alone.least >= LEAST_SPEED, -distance_error(driver, seen)

        self._best(name, merit)

    def _best(self, name: str, merit: Callable[[Path], Any]) -> None:
        merits = {seed: merit(self.workspace.policy(f"{name}_{seed}")) for seed in self.options.seeds}
        best = max(merits, key=merits.__getitem__)
        print(f"{name}: seed {best} of {merits}")
        self._keep(self.workspace.policy(f"{name}_{best}"), name)

    def _keep(self, path: Path, name: str) -> None:
        _copy(path, self.workspace.policy(name))


def _copy(path: Path, out: Path) -> None:
    with written_whole(out) as temporary:
        shutil.copyfile(path, temporary)
