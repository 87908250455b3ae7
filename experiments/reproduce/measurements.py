"""The measurements of `make reproduce`, from trained policies to results files."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network
from experiments.measure.crossing_order import order_results
from experiments.measure.horizon import measured
from experiments.measure.maneuver_gain import maneuver_results
from experiments.measure.runtime import Options as RuntimeOptions
from experiments.measure.runtime import runtime_results
from experiments.measure.validation_run import closed_loop_results
from experiments.models.sumo_predictor import predictions as sumo_predictions
from experiments.reproduce.stages import run_module
from experiments.reproduce.workspace import Workspace
from experiments.results_files import rows_of, write_result
from imitation.expert import expert_steps
from imitation.replay_error import constant_velocity_network, replay_error
from intersection_env.evaluation.errors import Forecaster, evaluate
from intersection_env.evaluation.moments import Moment, contested, moments_of
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scene import SPLITS

SIMULATED = Path("data/recordings").resolve()
SEED = 0  # of random choices in the measurements
UNTRAINED_SEED = 0
COMPARED = ("gail", "ppo", "idm", "idm_calibrated", "constant_velocity")  # in crossing orders


class Measurements:
    """The stages that measure; each writes a results file."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.options = workspace.options

    def run(self) -> None:
        """All of them; validation is opened after development."""
        for split in ("development", "validation"):
            for name, work in (("horizon", self._horizon), ("order", self._order), ("gap", self._gap_accuracy)):
                out = self.result(f"{name}_{split}")
                self.workspace.stage(out.stem, ["gail"], out, partial(work, split))
        self.workspace.stage("replay", ["gail"], self.result("replay_development"), self._replay)
        self.workspace.stage("maneuvers", ["gail"], self.result("maneuvers_validation"), self._maneuvers)
        self.workspace.stage("closed_loop", ["gail"], self.result("closed_loop"), self._closed_loop)
        self.workspace.stage("places", ["gail"], self.result("places"), self._places)
        timed = self.options.scenes_timed
        self.workspace.stage("runtime", ["gail"], self.result("runtime"), self._runtime, scenes=timed)
        self._write("default", json.loads(self.workspace.default.read_text(encoding="utf-8")))
        self._write("reproduced", {"about": self._about(), "seconds": self.workspace.seconds()})

    def result(self, name: str) -> Path:
        """A results file."""
        return self.options.out / f"{name}.json"

    def _horizon(self, split: str) -> None:
        scenes = self.workspace.scenes.select(split)
        everybody: list[Forecaster] = [*self._models().values()]
        for seed in self.options.seeds:
            everybody += [self._named(f"{name}_{seed}") for name in ("gail", "ppo")]
        moments, _ = moments_of(scenes)
        sumo, missing = self._sumo(moments)
        results = measured([*everybody, *sumo], moments)
        self._write(f"horizon_{split}", {"split": split, "missing": missing, **results})

    def _sumo(self, moments: Sequence[Moment]) -> tuple[list[Forecaster], dict[str, str]]:
        """SUMO as a predictor, and why not."""
        if self.workspace.places[0] != Intersection.load("bendplatz"):
            return [], {"sumo": "there is a network for Bendplatz only"}
        try:
            return [sumo_predictions([moment.traffic for moment in moments])], {}
        except ModuleNotFoundError as error:
            return [], {"sumo": str(error)}

    def _order(self, split: str) -> None:
        moments, _ = moments_of(self.workspace.scenes.select(split))
        models = self._models()
        results = order_results([models[name] for name in COMPARED], moments)
        self._write(f"order_{split}", {"split": split, **results})

    def _gap_accuracy(self, split: str) -> None:
        arguments = [
            *self.workspace.arguments(self.workspace.places[:1]),
            "--policy",
            str(self.workspace.policy("gap")),
        ]
        run_module("experiments.gap", *arguments, "--split", split, "--out", str(self.options.out))

    def _places(self) -> None:
        """Each model's errors at each place."""
        models = self._models().values()
        found: dict[str, Any] = {}
        for split in ("development", "validation"):
            found[split] = {}
            for place in self.workspace.all_scenes():
                moments, _ = moments_of(place.select(split))
                rows = [row for one in models for row in rows_of(evaluate(one, moments))]
                found[split][place.intersection.name] = {"moments": len(moments), "rows": rows}
        self._write("places", found)

    def _replay(self) -> None:
        scenes = self.workspace.scenes
        torch.manual_seed(UNTRAINED_SEED)
        networks = {"untrained": DrivingNetwork()}
        networks["constant_velocity"] = constant_velocity_network()
        for name in ("ppo", "gail"):
            for one in (name, *(f"{name}_{seed}" for seed in self.options.seeds)):
                networks[one] = driving_network(PolicyFile.read(self.workspace.policy(one)))
        found = {
            one: dataclasses.asdict(replay_error(network, scenes, "development")) for one, network in networks.items()
        }
        self._write("replay_development", found)

    def _maneuvers(self) -> None:
        moments, _ = moments_of(self.workspace.scenes.select("validation"))
        results = maneuver_results(self._named("gail"), contested(moments), SEED)
        self._write("maneuvers_validation", results)

    def _closed_loop(self) -> None:
        recorded = expert_steps(self.workspace.scenes, "validation").acceleration
        drivers = ["ppo", "gail", *(f"{name}_{seed}" for name in ("ppo", "gail") for seed in self.options.seeds)]
        place = self.workspace.places[0]
        results = closed_loop_results([self._named(one) for one in drivers], self._gaps(), recorded, map=place)
        self._write("closed_loop", results)

    def _runtime(self) -> None:
        timed = RuntimeOptions(policy=str(self.workspace.policy("gail")), scenes=self.options.scenes_timed)
        self._write("runtime", runtime_results(timed))

    def _models(self) -> dict[str, Predictor]:
        """The models of the comparison, by name; `idm` as in the paper: with its parameters and our gap network."""
        gap = PolicyFile.read(self.workspace.policy("gap"))
        models = [self._named(name) for name in ("gail", "ppo", "idm_calibrated")]
        models += [Predictor(gap, "idm"), Predictor(PolicyFile("critical_gap", "idm"), "idm_critical_gap")]
        models.append(Predictor.load("constant_velocity"))
        return {one.name: one for one in models}

    def _named(self, name: str) -> Predictor:
        return Predictor.load(self.workspace.policy(name))

    def _gaps(self) -> dict[str, str]:
        return {"gap": str(self.workspace.policy("gap")), "critical_gap": "critical_gap"}

    def _about(self) -> dict[str, Any]:
        scenes = self.workspace.scenes
        recordings = scenes.provenance["recordings"]
        of = {split: [one["id"] for one in recordings if one["split"] == split] for split in SPLITS}
        return {
            "name": "simulated" if self.options.recordings.resolve() == SIMULATED else self.options.recordings.name,
            "recordings_train": of["train"],
            "recordings_development": of["development"],
            "recordings_validation": of["validation"],
            "maps": [place.name for place in self.workspace.places],
            "hours": round(sum(one["seconds"] for one in recordings) / 3600.0, 3),
        }

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        write_result(self.result(name), content)
