"""The measurements of `make reproduce`, from trained policies to results files."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network
from experiments.measure.crossing_order import order_results
from experiments.measure.driven_gain import MOMENTS, driven_results
from experiments.measure.forecast import forecast_results
from experiments.measure.forecasters import MeanOverOrders, MostProbableOrder
from experiments.measure.horizon import measured
from experiments.measure.maneuver_gain import maneuver_results
from experiments.measure.perception import MOMENTS as PERCEIVED
from experiments.measure.perception import perception_results
from experiments.measure.runtime import Options as RuntimeOptions
from experiments.measure.runtime import runtime_results
from experiments.measure.validation_run import closed_loop_results
from experiments.models.patient import patient
from experiments.models.sumo_predictor import predictions as sumo_predictions
from experiments.reproduce.stages import run_module
from experiments.reproduce.workspace import Workspace
from experiments.results_files import rows_of, write_result
from imitation.expert import expert_steps
from imitation.replay_error import constant_velocity_network, replay_error
from intersection_env.constants import DT, STEPS
from intersection_env.evaluation.errors import Forecaster, evaluate
from intersection_env.evaluation.moments import Moment, contested, moments_of, thinned
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scene import SPLITS

SEED = 0  # of random choices in the measurements
UNTRAINED_SEED = 0
COMPARED = ("gail", "ppo", "rollout_gradient", "idm", "idm_calibrated", "constant_velocity")  # in crossing orders
DRIVERS = ("ppo", "gail", "rollout_gradient")  # with networks
INFORMED = ("rollout_gradient", "gail", "idm_calibrated")  # predict with the recorded order handed in too
PATIENT = "rollout_gradient"  # predicts with patience kept too
FORECASTING = "rollout_gradient"  # of those that can: the one that predicts best
TIMES = {"at_4s": round(4.0 / DT), "at_10s": STEPS}  # of driving alone


class Measurements:
    """The stages that measure; each writes a results file."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self.options = workspace.options

    def run(self) -> None:
        """All of them; validation is opened after development."""
        for split in ("development", "validation"):
            of_split = {"horizon": self._horizon, "order": self._order, "gap": self._gap_accuracy}
            for name, work in (of_split | {"replay": self._replay, "forecast": self._forecast}).items():
                self._stage(f"{name}_{split}", f"{name}_{split}", partial(work, split))
        self._stage("perception", "perception_validation", self._perception)
        self._stage("maneuvers", "maneuvers_validation", self._maneuvers)
        self._stage("driven_gain", "driven_gain_validation", self._driven_gain)
        self._stage("closed_loop", "closed_loop", self._closed_loop)
        self._stage("places", "places", self._places)
        self._stage("runtime", "runtime", self._runtime, scenes=self.options.scenes_timed)
        self._write("default", json.loads(self.workspace.default.read_text(encoding="utf-8")))
        self._write("reproduced", {"about": self._about(), "seconds": self.workspace.seconds()})

    def _stage(self, name: str, result: str, work: Callable[[], None], **inputs: Any) -> None:
        """One that begins when the policies are trained and the default is chosen, and writes a results file."""
        self.workspace.stage(name, ["default"], self.result(result), work, **inputs)

    def result(self, name: str) -> Path:
        """A results file."""
        return self.options.out / f"{name}.json"

    def _horizon(self, split: str) -> None:
        scenes = self.workspace.scenes.select(split)
        everybody: list[Forecaster] = [*self._models().values()]
        for seed in self.options.seeds:
            everybody += [self._named(f"{name}_{seed}") for name in ("gail", "ppo", "rollout_gradient")]
        moments, _ = moments_of(scenes)
        sumo, missing = self._sumo(moments)
        everybody.append(patient(self._named(PATIENT)))
        everybody += [form(self._forecasting(FORECASTING)) for form in (MostProbableOrder, MeanOverOrders)]
        results = measured([*everybody, *sumo], moments, [self._named(name) for name in INFORMED])
        self._write(f"horizon_{split}", {"split": split, "missing": missing, **results})

    def _driven_gain(self) -> None:
        """Of the default, where SUMO can drive on; else why not."""
        results: dict[str, Any] = {"missing": self._no_sumo()}
        if not results["missing"]:
            moments, _ = moments_of(self.workspace.scenes.select("validation"))
            results = driven_results(self._forecasting(self._default), thinned(contested(moments), MOMENTS), SEED)
        self._write("driven_gain_validation", {"split": "validation", **results})

    def _no_sumo(self) -> dict[str, str]:
        """Why SUMO cannot drive here; empty where it can."""
        if self.workspace.places[0] != Intersection.load("bendplatz"):
            return {"sumo": "there is a network for Bendplatz only"}
        return {} if find_spec("libsumo") else {"sumo": "sumo is not installed: pip install -e '.[sumo]'"}

    def _sumo(self, moments: Sequence[Moment]) -> tuple[list[Forecaster], dict[str, str]]:
        """SUMO as a predictor, and why not."""
        missing = self._no_sumo()
        return ([] if missing else [sumo_predictions([moment.traffic for moment in moments])]), missing

    def _order(self, split: str) -> None:
        moments, _ = moments_of(self.workspace.scenes.select(split))
        models = self._models()
        results = order_results([*(models[name] for name in COMPARED), patient(models[PATIENT])], moments)
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

    def _replay(self, split: str) -> None:
        """Driving alone, as drivers are and within a prediction's limits; the rollout gradient's knows these alone."""
        torch.manual_seed(UNTRAINED_SEED)
        freely = {"untrained": DrivingNetwork(), "constant_velocity": constant_velocity_network()}
        freely |= {one: self._driver(one) for name in ("ppo", "gail") for one in self._with_seeds(name)}
        within = {name: network for name, network in freely.items() if name != "untrained"}
        within |= {one: self._driver(one) for one in self._with_seeds("rollout_gradient")}
        scenes = self.workspace.scenes
        found: dict[str, Any] = {}
        for key, networks in (("freely", freely), ("within_limits", within)):
            errors_of = partial(replay_error, scenes=scenes, split=split, within_limits=key == "within_limits")
            found[key] = {
                name: {time: dataclasses.asdict(errors_of(network, steps=steps)) for time, steps in TIMES.items()}
                for name, network in networks.items()
            }
        self._write(f"replay_{split}", found)

    def _forecast(self, split: str) -> None:
        """At all places: others' models learn there too."""
        results = forecast_results(self._forecasting(FORECASTING), self.workspace.all_scenes(), split)
        self._write(f"forecast_{split}", {"split": split, **results})

    def _perception(self) -> None:
        moments, _ = moments_of(self.workspace.scenes.select("validation"))
        chosen = thinned(contested(moments), PERCEIVED)
        results = perception_results(self._forecasting(self._default), chosen, SEED)
        self._write("perception_validation", {"split": "validation", **results})

    def _maneuvers(self) -> None:
        moments, _ = moments_of(self.workspace.scenes.select("validation"))
        results = maneuver_results(self._forecasting(self._default), contested(moments), SEED)
        self._write("maneuvers_validation", results)

    def _closed_loop(self) -> None:
        recorded = expert_steps(self.workspace.scenes, "validation").acceleration
        drivers = [*DRIVERS, *(f"{name}_{seed}" for name in DRIVERS for seed in self.options.seeds)]
        place = self.workspace.places[0]
        results = closed_loop_results([self._named(one) for one in drivers], self._gaps(), recorded, map=place)
        self._write("closed_loop", results)

    def _runtime(self) -> None:
        """Of the default, if it has both networks; the paper's driver otherwise."""
        timed = self._default if self._default in DRIVERS else "gail"
        policy = str(self.workspace.policy(timed))
        self._write("runtime", runtime_results(RuntimeOptions(policy=policy, scenes=self.options.scenes_timed)))

    def _models(self) -> dict[str, Predictor]:
        """The models of the comparison, by name; `idm` as in the paper: with its parameters and our gap network."""
        gap = PolicyFile.read(self.workspace.policy("gap"))
        models = [self._named(name) for name in ("gail", "ppo", "rollout_gradient", "idm_calibrated")]
        models += [Predictor(gap, "idm"), Predictor(PolicyFile("critical_gap", "idm"), "idm_critical_gap")]
        models.append(Predictor.load("constant_velocity"))
        return {one.name: one for one in models}

    def _named(self, name: str) -> Predictor:
        return Predictor.load(self.workspace.policy(name))

    def _forecasting(self, name: str) -> Predictor:
        return Predictor.load(self.workspace.forecasting(name))

    def _with_seeds(self, name: str) -> list[str]:
        """A driver's policies: the best one, and one a seed."""
        return [name, *(f"{name}_{seed}" for seed in self.options.seeds)]

    def _driver(self, name: str) -> DrivingNetwork:
        return driving_network(PolicyFile.read(self.workspace.policy(name)))

    @property
    def _default(self) -> str:
        """The name of the default policy."""
        return str(json.loads(self.workspace.default.read_text(encoding="utf-8"))["default"])

    def _gaps(self) -> dict[str, str]:
        return {"gap": str(self.workspace.policy("gap")), "critical_gap": "critical_gap"}

    def _about(self) -> dict[str, Any]:
        scenes = self.workspace.scenes
        recordings = scenes.provenance["recordings"]
        of = {split: [one["id"] for one in recordings if one["split"] == split] for split in SPLITS}
        return {
            "name": "simulated" if self.workspace.simulated else self.options.recordings.name,
            "recordings_train": of["train"],
            "recordings_development": of["development"],
            "recordings_validation": of["validation"],
            "maps": [place.name for place in self.workspace.places],
            "hours": round(sum(one["seconds"] for one in recordings) / 3600.0, 3),
        }

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        write_result(self.result(name), content)
