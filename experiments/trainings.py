"""The trainings of `make reproduce`: scenes, gap network, calibrated IDM, PPO and GAIL."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from agents.idm import distance_error, moments
from agents.ppo import PROFILES as PPO_PROFILES
from agents.run_folder import file_hash
from data.build import build
from data.build import summary as scenes_summary
from experiments.evaluation import starts
from experiments.job import Job
from experiments.stages import run_module, run_trainings
from imitation.gail import PROFILES as GAIL_PROFILES
from intersection_env.files import written_whole
from intersection_env.intersection import Intersection
from intersection_env.policy import PolicyFile
from intersection_env.predictor import Predictor
from intersection_env.scenes import SPLITS, Scenes

BETWEEN_MOMENTS = 4.0  # [s], by which the best seed is found


class Trainings:
    """The stages that learn, each from what came before."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.options = job.options

    def run(self) -> None:
        """Scenes, gap network, calibrated IDM, PPO, GAIL; of the last two one a seed, and then the best."""
        options, seeds = self.options, list(self.options.seeds)
        epochs = {"ppo": PPO_PROFILES["fast"][1].epochs, "gail": GAIL_PROFILES["default"][1].epochs}
        if options.epochs is not None:
            epochs = dict.fromkeys(epochs, options.epochs)
        hashes = {path.name: file_hash(path) for path in sorted(options.recordings.glob("*")) if path.is_file()}
        stage, policy = self.job.stage, self.job.policy
        stage("scenes", [], self.job.scenes, self._scenes, recordings=hashes, map=options.map)
        stage("gap", ["scenes"], policy("gap"), self._gap)
        stage("idm", ["gap"], policy("idm_calibrated"), self._idm)
        stage("ppo", ["gap"], policy("ppo"), lambda: self._ppo(epochs["ppo"]), seeds=seeds, epochs=epochs)
        stage("gail", ["ppo"], policy("gail"), lambda: self._gail(epochs["gail"]))

    def _scenes(self) -> None:
        intersection = Intersection.load(self.options.map)
        scenes = build(self.options.recordings, intersection)
        print(scenes_summary(scenes))
        for split in SPLITS:
            if not starts(scenes.select(split))[0]:
                raise ValueError(f'{self.options.recordings}: no scene for split "{split}" with vehicles to predict')
        scenes.save(self.job.scenes)

    def _gap(self) -> None:
        run = self.job.run_of("gap")
        run_module("agents.gap", "default", "--scenes", str(self.job.scenes), "--run", str(run), "--resume")
        self._keep(run / "gap.policy", "gap")

    def _idm(self) -> None:
        gap, out = str(self.job.policy("gap")), str(self.job.policy("idm_calibrated"))
        run_module("agents.idm", "--scenes", str(self.job.scenes), "--gap", gap, "--out", out)

    def _ppo(self, epochs: int) -> None:
        arguments = ["--map", self.options.map, "--gaps", str(self.job.policy("gap")), "critical_gap"]
        self._seeds("ppo", epochs, lambda seed: ["agents.ppo", "fast", *arguments])

        def reward(path: Path) -> float:
            runs = PolicyFile.read(path).about["validation_run"].values()
            return float(sum(run["reward"] for run in runs))

        self._best("ppo", reward)

    def _gail(self, epochs: int) -> None:
        arguments = ["--scenes", str(self.job.scenes), "--decider", str(self.job.policy("gap"))]
        self._seeds(
            "gail",
            epochs,
            lambda seed: ["imitation.gail", "default", *arguments, "--ppo", str(self.job.run_of(f"ppo_{seed}"))],
        )
        asked = moments(Scenes.load(self.job.scenes).select("development"), BETWEEN_MOMENTS)
        self._best("gail", lambda path: -distance_error(Predictor.load(path), asked))

    def _seeds(self, name: str, epochs: int, command: Callable[[int], list[str]]) -> None:
        cores = os.cpu_count() or 1
        at_once = min(cores, len(self.options.seeds))
        common = ["--epochs", str(epochs), "--threads", str(cores // at_once), "--resume"]
        trainings = {}
        for seed in self.options.seeds:
            run = self.job.run_of(f"{name}_{seed}")
            trainings[run] = [*command(seed), *common, "--seed", str(seed), "--run", str(run)]
        run_trainings(trainings, epochs, at_once)
        for seed in self.options.seeds:
            self._keep(self.job.run_of(f"{name}_{seed}") / f"{name}.policy", f"{name}_{seed}")

    def _best(self, name: str, merit: Callable[[Path], float]) -> None:
        merits = {seed: merit(self.job.policy(f"{name}_{seed}")) for seed in self.options.seeds}
        best = max(merits, key=merits.__getitem__)
        print(f"{name}: seed {best} of {merits}")
        self._keep(self.job.policy(f"{name}_{best}"), name)

    def _keep(self, path: Path, name: str) -> None:
        with written_whole(self.job.policy(name)) as temporary:
            shutil.copyfile(path, temporary)
