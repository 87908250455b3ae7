"""Each ablation changes what it says, and is measured from the policies that come of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import torch
import tyro

from agents.gap.train import PROFILES as GAP_PROFILES
from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_policy
from agents.training.folder import METRICS, decisive
from experiments.models import lead_across
from experiments.reproduce import ablations, rollout_variants, variants
from experiments.reproduce import workspace as workspaces
from experiments.reproduce.ablations import DEFAULT_GAIL, DEFAULT_GAP, GAIL, GAP, Ablations
from experiments.reproduce.rollout_variants import DEFAULT_ROLLOUTS, NO_LARGER, ROLLOUTS, WIDER, RolloutVariants
from experiments.reproduce.variants import CONSTANT_VELOCITY, SHARE
from experiments.reproduce.workspace import Options, Workspace
from experiments.show.ablations import ablation_tables, gail_table, gap_table, lead_table, left_out_table, rollout_table
from imitation.gail import PROFILES as GAIL_PROFILES
from imitation.rollout_gradient import PROFILES as ROLLOUT_PROFILES
from intersection_env.evaluation import intervals
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.named import gap_decider
from tests.support.scenes import small_scenes

Trainings = dict[Path, list[str]]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """One in which the trainings are done: small scenes, the shipped policies."""
    made = Workspace(Options(map=("bendplatz",), seeds=(5,), work=tmp_path / "work", out=tmp_path / "out"))
    made.keys |= {"scenes_bendplatz": "some", "default": "others"}
    small_scenes("train", "development").save(made.scenes_of(made.places[0]))
    for name in ("gap", "idm_calibrated", "gail"):
        made.policy(name).parent.mkdir(parents=True, exist_ok=True)
        made.policy(name).write_text(Path(f"intersection_env/policies/{name}.policy").read_text())
    driver(made.run_of("ppo_5") / "ppo.policy")
    driver(made.run_of("gail_5") / "gail.policy")
    driver(made.run_of("rollout_gradient_5") / "rollout_gradient.policy")
    made.run_of("gap").mkdir(parents=True)
    (made.run_of("gap") / "gap.policy").write_text(made.policy("gap").read_text())
    return made


def larger(places: Sequence[Intersection], folder: Path) -> list[tuple[Path, Path]]:
    """Stands in for the simulation of larger places."""
    return [(Path(f"{one.name}_150.npz"), Path(f"{one.name}_150.json")) for one in places]


def driver(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    driving_policy(gap_decider("gap"), DrivingNetwork(), {}).save(path)
    rows = [{"epoch": 1}, {"predicted": 3.0}, {"predicted": 2.0}, {"predicted": 2.5}] if path.stem == "gail" else [{}]
    (path.parent / METRICS).write_text("".join(f"{json.dumps(row)}\n" for row in rows))


def trained(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Trainings:
    """The commands that a run of the ablations gives, each of which leaves a policy."""
    commands: Trainings = {}

    def train(trainings: Mapping[Path, Sequence[str]], epochs: int, at_once: int) -> None:
        for run, command in trainings.items():
            commands[run] = list(command)
            run.mkdir(parents=True, exist_ok=True)
            if command[0] == "agents.gap":
                (run / "gap.policy").write_text(workspace.policy("gap").read_text())
            else:
                driver(run / f"{command[0].removeprefix('imitation.')}.policy")

    monkeypatch.setattr(variants, "run_trainings", train)
    monkeypatch.setattr(intervals, "RESAMPLES", 20)
    monkeypatch.setattr(rollout_variants, "wider_scenes", lambda places, folder: [Path("wider.npz")])
    monkeypatch.setattr(workspaces, "larger_scenes", larger)
    monkeypatch.setattr(ablations, "LEAD_MOMENTS", 8)
    monkeypatch.setattr(lead_across, "STANDING", 50.0)  # in so few moments nobody stands
    torch.manual_seed(0)
    Ablations(workspace).run()
    return commands


def test_every_variant_is_trained_and_measured_once(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = trained(workspace, monkeypatch)
    assert len(commands) == len(GAP) + len(GAIL) + len(ROLLOUTS) + 2
    results = json.loads((workspace.options.out / "ablations.json").read_text())
    assert list(results["gap"]) == [CONSTANT_VELOCITY, DEFAULT_GAP, *GAP]
    starts = "PPO alone, without GAIL", "the rollout gradient's driver, without GAIL"
    assert list(results["gail"]) == [CONSTANT_VELOCITY, *starts, f"{DEFAULT_GAIL}, seed 5", *GAIL]
    seen = [row["checkpoints"] for row in results["gail"].values()]
    assert seen == [None] * 3 + [{"best": 2.0, "last": 2.5}] * (1 + len(GAIL))
    steady, first, *others = results["gap"].values()
    assert all(row == first for row in others), "the same network, measured differently"
    assert steady["frames"] is None
    assert steady["until_last_seen"] == results["gail"][CONSTANT_VELOCITY]["until_last_seen"]
    assert gap_table(results["gap"]).count("\n") == 3 + len(GAP)
    assert gail_table(results["gail"]).count("\n") == 5 + len(GAIL)
    unchanged = f"{DEFAULT_ROLLOUTS}, seed 5"
    assert list(results["rollout_gradient"]) == [CONSTANT_VELOCITY, unchanged, *ROLLOUTS, WIDER, NO_LARGER]
    assert results["rollout_gradient"][CONSTANT_VELOCITY]["empty_road"] == 0.0
    assert rollout_table(results["rollout_gradient"]).count("\n") == 5 + len(ROLLOUTS)
    assert results["left_out"] == {}, "there is one place only"
    assert len(ablation_tables(results).split("\n\n")) == 4
    del results["rollout_gradient"]
    assert len(ablation_tables(results).split("\n\n")) == 3, "what was not measured has no table"
    _, in_core, in_torch, across = results["lead"].values()
    assert in_torch["at_10s"]["distance_rmse"]["value"] == pytest.approx(
        in_core["at_10s"]["distance_rmse"]["value"], abs=1e-3
    )
    assert across != in_torch, "nobody was ever across a path"
    assert lead_table(results["lead"]).count("\n") == 5
    assert not trained(workspace, monkeypatch), "done again"


def test_variants_change_what_they_say_and_nothing_else(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    def settings(profiles: Any, command: list[str]) -> dict[str, Any]:
        found = tyro.extras.overridable_config_cli(profiles, args=command[1:])
        return {**decisive(found), "run": None, "ppo": getattr(found, "ppo", None)}

    commands = list(trained(workspace, monkeypatch).values())
    gaps = [settings(GAP_PROFILES, one) for one in commands if one[0] == "agents.gap"]
    default = settings(GAP_PROFILES, ["agents.gap", "default"])
    assert [one["noise"] for one in gaps] == [0.0, 1.0]
    assert all(one == {**default, "noise": one["noise"]} for one in gaps)
    drivers = [settings(GAIL_PROFILES, one) for one in commands if one[0] == "imitation.gail"]
    start = ["--ppo", str(workspace.run_of("ppo_5")), "--decider", str(workspace.policy("gap")), "--seed", "5"]
    half = ["--epochs", str(round(SHARE * GAIL_PROFILES["default"][1].epochs))]
    default = settings(GAIL_PROFILES, ["imitation.gail", "default", *start, *half])
    changed = [{key for key in one if one[key] != default[key]} for one in drivers]
    assert changed == [
        *(set(), {"bootstrap_ends"}, {"kept"}, {"cloning"}, *[{"discriminator"}] * 4),
        *({"last_sigma"}, {"update"}, {"gap"}, {"ppo"}, {"policy"}),
    ]
    whole = default["discriminator"]
    parts = [{key: part for key, part in one["discriminator"].items() if part != whole[key]} for one in drivers[4:8]]
    assert parts == [
        {"minibatches": 1},
        {"gradient_penalty": 1.0},
        {"gradient_penalty": 0.0},
        {"smoothing": 0.0, "noise": 0.0},
    ]
    assert drivers[-2]["ppo"] is None
    assert drivers[-1]["policy"] == str(workspace.run_of("rollout_gradient_5") / "rollout_gradient.policy")
    rollouts = [settings(ROLLOUT_PROFILES, one) for one in commands if one[0] == "imitation.rollout_gradient"]
    half = ["--epochs", str(round(SHARE * ROLLOUT_PROFILES["default"][1].epochs))]
    start = ["--decider", str(workspace.policy("gap")), "--teacher", str(workspace.policy("idm_calibrated"))]
    default = settings(ROLLOUT_PROFILES, ["imitation.rollout_gradient", "default", *start, *half, "--seed", "5"])
    changes = [{key: one[key] for key in one if one[key] != default[key]} for one in rollouts]
    assert changes == [
        {},
        {"alone_share": 1.0},
        {"alone_share": 0.0},
        {"joint_weight": 3.0},
        {"learns_gaps": False},
        {"steps": 25},
        {"every": 12.0},
        {"limits": [1.0], "every": 1.0},
        {"speed_weight": 0.0},
        {"noise": 0.1},
        {"free_share": 0.0},
        {"huber": 1.0},
        {"gap_huber": 3.0},
        {},
        {},
    ]
    usual = str(workspace.scenes_of(workspace.places[0]))
    scenes = [command[command.index("--scenes") + 1 : command.index("--map")] for command in commands[-3:]]
    assert scenes == [[usual, "bendplatz_150.npz"], ["wider.npz", "bendplatz_150.npz"], [usual]]


def test_places_are_left_out_one_at_a_time_and_predicted_by_who_does_not_know_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Workspace(Options(map=("bendplatz", "t_junction"), seeds=(5,), work=tmp_path / "work"))
    made.keys |= {"scenes_bendplatz": "some", "scenes_t_junction": "some"}
    for place in made.places:
        small_scenes("train", "development", place=place.name).save(made.scenes_of(place))
    driver(made.run_of("rollout_gradient_5") / "rollout_gradient.policy")
    told: Trainings = {}

    def train(trainings: Mapping[Path, Sequence[str]], epochs: int, at_once: int) -> None:
        for run, command in trainings.items():
            told[run] = list(command)
            driver(run / "rollout_gradient.policy")

    monkeypatch.setattr(variants, "run_trainings", train)
    monkeypatch.setattr(rollout_variants, "wider_scenes", lambda places, folder: [Path("wider.npz")])
    monkeypatch.setattr(workspaces, "larger_scenes", larger)
    monkeypatch.setattr(intervals, "RESAMPLES", 20)
    torch.manual_seed(0)
    found = RolloutVariants(made)
    found.train()
    places = {
        run.name.removeprefix("ablation_rollouts_"): command[command.index("--map") + 1 : command.index("--decider")]
        for run, command in told.items()
    }
    both = ["bendplatz", "t_junction", "bendplatz_150.json", "t_junction_150.json"]
    assert all(places.pop(str(number)) == both for number in range(len(ROLLOUTS)))
    assert places == {
        "only_bendplatz": ["bendplatz", "bendplatz_150.json"],
        "without_bendplatz": ["t_junction", "t_junction_150.json"],
        "without_t_junction": ["bendplatz", "bendplatz_150.json"],
        "wider": both,
        "no_larger": both[:2],
    }
    rows = found.left_out()
    assert list(rows) == ["bendplatz", "t_junction"]
    for row in rows.values():
        ratio = row["left_out"]["distance_rmse"]["value"] / row["everywhere"]["distance_rmse"]["value"]
        assert row["left_out"]["distance_rmse_to_everywhere"]["value"] == pytest.approx(ratio)
        row["left_out"]["distance_rmse_to_everywhere"]["value"] = 1.25
    assert left_out_table(rows).count(": met |") == 2
    rows["bendplatz"]["left_out"]["distance_rmse_to_everywhere"]["value"] = 1.26
    assert left_out_table(rows).count(": **missed** |") == 1
