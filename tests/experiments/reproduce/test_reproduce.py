"""`make reproduce` refuses bad recordings before it trains, goes on where it was, and ships what is best."""

from __future__ import annotations

import itertools
import json
import shutil
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_policy, gap_hash
from agents.ppo import PROFILES as PPO_PROFILES
from experiments.measure.runtime import Options as RuntimeOptions
from experiments.reproduce import measurements, reproduce, trainings
from experiments.reproduce.default import default_of
from experiments.reproduce.measurements import Measurements
from experiments.reproduce.reproduce import main
from experiments.reproduce.stages import StageFailedError
from experiments.reproduce.trainings import TRAINED
from experiments.reproduce.workspace import Options, Workspace
from experiments.results_files import rounded
from experiments.show.places import place_table
from imitation.gail import PROFILES as GAIL_PROFILES
from imitation.replay_error import constant_velocity_network
from imitation.rollout_gradient import PROFILES as ROLLOUTS
from intersection_env import Intersection, Predictor, Scene, Scenes
from intersection_env.evaluation.empty_road import EmptyRoad
from intersection_env.evaluation.gates import LEAST_SPEED
from intersection_env.evaluation.moments import moments_of
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import POLICIES, gap_decider
from intersection_env.scenes.scene import Track
from tests.support.own_place import own_map, own_recordings
from tests.support.recordings import on_route, steady, write_recording

MEASURED = (
    *("_horizon", "_order", "_gap_accuracy", "_replay", "_forecast"),
    *("_perception", "_maneuvers", "_driven_gain", "_closed_loop", "_places", "_runtime"),
)
STAGES = ("scenes_bendplatz", "gap", "idm", "rollout_gradient", "ppo", "gail", "forecasts")
MERITS = {
    **{"rollout_gradient_3": -3.0, "rollout_gradient_4": -2.0, "rollout_gradient_5": -1.0},
    **{"ppo_3": 0.1, "ppo_4": 0.3, "ppo_5": 0.2, "gail_3": -4.0, "gail_4": -5.0, "gail_5": -6.0},
}


def record(folder: Path, *ids: str, location: int = 1) -> Path:
    """Recordings in inD's format, of two cars each that drive steadily for 13 s."""
    bendplatz = Intersection.load("bendplatz")
    movers = [
        on_route(bendplatz, route, k, 0.0, steady(100.0, 7.0), 13.0) for k, route in enumerate(("NW-SE", "SE-NW"))
    ]
    for id in ids:
        write_recording(folder, id, movers, location)
    return folder


@pytest.fixture
def options(tmp_path: Path) -> Options:
    """Of three recordings, one for each split."""
    recordings = record(tmp_path / "recordings", "07", "08", "09")
    return Options(recordings, seeds=(3, 4, 5), work=tmp_path / "work", out=tmp_path / "out", only="training")


class Trainer:
    """Stands in for the processes that train: writes what they would, at once, and counts."""

    def __init__(self) -> None:
        self.modules: list[str] = []
        self.told: list[list[str]] = []
        self.folders: list[str] = []
        self.epochs: set[int] = set()

    def run_module(self, module: str, *arguments: str) -> None:
        self.modules.append(module)
        self.told.append([module, *arguments])
        told = dict(itertools.pairwise(arguments))
        name = "orders.policy" if module == "agents.orders" else "gap.policy"
        out = Path(told["--out"]) if "--out" in told else Path(told["--run"]) / name
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(POLICIES / ("gap.policy" if name == "orders.policy" else out.name), out)

    def run_trainings(self, commands: Mapping[Path, Sequence[str]], epochs: int, at_once: int) -> None:
        assert 1 <= at_once <= len(commands)
        self.epochs.add(epochs)
        self.told += [list(command) for command in commands.values()]
        for run in commands:
            self.folders.append(run.name)
            run.mkdir(parents=True, exist_ok=True)
            about = {"validation_run": {"bendplatz": {"gap": {"reward": MERITS[run.name]}}}, "name": run.name}
            name = run.name.rpartition("_")[0]
            driving_policy(gap_decider("gap"), DrivingNetwork(), about).save(run / f"{name}.policy")


@pytest.fixture
def trainer(monkeypatch: pytest.MonkeyPatch) -> Trainer:
    trainer = Trainer()
    monkeypatch.setattr(trainings, "run_module", trainer.run_module)
    monkeypatch.setattr(trainings, "run_trainings", trainer.run_trainings)
    monkeypatch.setattr(trainings, "distance_error", lambda predictor, _: -MERITS[predictor.name])
    monkeypatch.setattr(trainings, "empty_road", lambda *_: EmptyRoad(1.0, 1.0, "", 1))  # its networks are random
    return trainer


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was measured, in order, by a stand-in that writes empty results; and that a report was written."""
    done: list[str] = []

    def stand_in(name: str) -> Callable[..., None]:
        def work(self: Measurements, *split: str) -> None:
            done.append("_".join((name, *split)))
            results = {"_gap_accuracy": "gap"} | {
                one: f"{one[1:]}_validation" for one in ("_perception", "_maneuvers", "_driven_gain")
            }
            self._write("_".join((results.get(name, name[1:]), *split)), {})

        return work

    for name in MEASURED:
        monkeypatch.setattr(Measurements, name, stand_in(name))
    monkeypatch.setattr(reproduce, "write_report", lambda out: done.append("report"))
    return done


def never(*_: object) -> None:
    raise AssertionError("a training began")


def malformed(folder: Path) -> Path:
    record(folder, "07", "08", "09")
    table = folder / "08_tracks.csv"
    table.write_text(table.read_text(encoding="utf-8").replace("xCenter", "x"), encoding="utf-8")
    return folder


def another_data_set(folder: Path) -> Path:
    folder.mkdir()
    (folder / "vehicle_tracks_000.csv").write_text("track_id,frame_id,timestamp_ms\n1,1,100\n", encoding="utf-8")
    return folder


def empty(folder: Path) -> Path:
    folder.mkdir()
    return folder


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda folder: folder, "bad"),
        (empty, "bad"),
        (another_data_set, "bad"),
        (malformed, "08_tracks.csv"),
        (lambda folder: record(folder, "00", "01", location=4), "the recordings are of location 4"),
        (lambda folder: record(folder, "07"), 'no scene for split "development"'),
        (lambda folder: record(folder, "07", "08"), 'no scene for split "development"'),
    ],
    ids=["missing", "empty", "another data set", "malformed", "without a map", "one", "two"],
)
def test_bad_recordings_are_named_before_anything_is_trained(
    make: Callable[[Path], Path],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for module, name in ((trainings, "run_module"), (trainings, "run_trainings"), (measurements, "run_module")):
        monkeypatch.setattr(module, name, never)
    recordings = make(tmp_path / "bad")
    assert main(Options(recordings, work=tmp_path / "work", out=tmp_path / "out")) == 1
    printed = capsys.readouterr()
    assert printed.err.splitlines()[-1].startswith("error: ")
    assert said in printed.err
    assert "[gap]" not in printed.out
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "work" / "scenes").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"map": ("nowhere",)}, 'no map "nowhere" ships (there are all_way_stop, bendplatz, crossroads,'),
        ({"map": ("bendplatz", "t_junction")}, 'map "t_junction": no recording in'),
        ({"map": ("bendplatz", "intersection_env/maps/bendplatz.json")}, 'two maps are called "bendplatz"'),
        ({"seeds": ()}, "--seeds names no seed"),
        ({"effort": -1.0}, "--effort is -1; wanted more than 0"),
    ],
)
def test_bad_options_are_named_before_anything_is_trained(
    change: dict[str, object],
    said: str,
    options: Options,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(trainings, "run_module", never)
    assert main(replace(options, **change)) == 1  # type: ignore[arg-type]
    assert said in capsys.readouterr().err


def test_training_keeps_the_best_seed_of_each_driver(options: Options, trainer: Trainer) -> None:
    assert main(options) == 0
    assert trainer.modules == ["agents.gap", "agents.idm", "agents.orders"]
    assert trainer.folders == list(MERITS)
    policies = options.work / "policies"
    assert {path.stem for path in policies.iterdir()} == {*TRAINED, *MERITS}
    kept = {name: PolicyFile.read(policies / f"{name}.policy") for name in ("ppo", "gail", "rollout_gradient")}
    assert [one.about["name"] for one in kept.values()] == ["ppo_4", "gail_3", "rollout_gradient_5"]
    for name in TRAINED:
        plain, forecasting = (
            PolicyFile.read(options.work / of / f"{name}.policy") for of in ("policies", "forecasting")
        )
        assert forecasting.order_network is not None
        assert gap_hash(plain) == gap_hash(forecasting)
    assert not options.out.exists()


def test_each_training_is_told_what_it_knows_and_begins_with_what_came_before(
    options: Options, trainer: Trainer
) -> None:
    profiles: dict[str, Any] = {
        "agents.ppo": PPO_PROFILES,
        "imitation.gail": GAIL_PROFILES,
        "imitation.rollout_gradient": ROLLOUTS,
    }
    assert main(options) == 0
    policies = options.work / "policies"
    seen = []
    for module, *told in (one for one in trainer.told if one[0] in profiles):
        settings: Any = tyro.extras.overridable_config_cli(profiles[module], args=told)
        seen.append((module, settings.seed))
        if module == "imitation.rollout_gradient":
            assert (settings.decider, settings.teacher) == tuple(
                str(policies / f"{name}.policy") for name in ("gap", "idm_calibrated")
            )
            assert settings.resume
    modules = ("imitation.rollout_gradient", "agents.ppo", "imitation.gail")
    assert seen == [(module, seed) for module in modules for seed in options.seeds]


def test_driver_that_crawls_on_an_empty_road_is_kept_only_if_every_seed_does(
    options: Options, trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of GAIL's seeds 3 predicts best, then 4; of the rollout gradient's 5, then 4."""

    def alone(driver: Predictor, *_: object) -> EmptyRoad:
        return EmptyRoad(0.1 if driver.name in ("gail_3", "rollout_gradient_5") else LEAST_SPEED, 1.0, "", 1)

    monkeypatch.setattr(trainings, "empty_road", alone)
    assert main(options) == 0
    policies = options.work / "policies"
    for name in ("gail", "rollout_gradient"):
        assert PolicyFile.read(policies / f"{name}.policy").about["name"] == f"{name}_4"


def test_default_predicts_best_of_those_that_pass(options: Options, trainer: Trainer) -> None:
    assert main(options) == 0
    found = json.loads((options.work / "default.json").read_text(encoding="utf-8"))
    assert set(found["policies"]) == set(TRAINED)
    passing = {name: row for name, row in found["policies"].items() if not row["refusals"]}
    assert {"gap", "idm_calibrated"} <= set(passing)
    errors = {name: row["until_last_seen"]["rmse"] for name, row in passing.items()}
    assert errors[found["default"]] == min(errors.values())
    assert found["constant_velocity"]["rmse"] < 0.5  # all drive steadily


def test_policy_that_predicts_best_but_stands_is_no_default() -> None:
    """Two cars wait for each other's going, so to say: they stand, and so does who never accelerates."""
    bendplatz = Intersection.load("bendplatz")
    still = np.full(51, 60.0, np.float32), np.zeros(51, np.float32), np.zeros(51, np.float32)
    tracks = [
        Track(f"07/{k}", "car", bendplatz.route_index(route), 4.5, 1.8, 0, *still, np.ones(51, np.bool_))
        for k, route in enumerate(("NW-SE", "SE-NW"))
    ]
    scenes = Scenes(bendplatz, (Scene("07/0", "07", "development", 0.0, 51, tuple(tracks)),), {}, {})
    moments = moments_of(scenes)[0]
    stands = Predictor(driving_policy(gap_decider("gap"), constant_velocity_network(), {}), "stands")
    idm = Predictor.load("idm_calibrated")
    found = default_of([stands, idm], moments, idm)
    assert found["policies"]["stands"]["until_last_seen"]["rmse"] == 0.0
    assert "on an empty road" in found["policies"]["stands"]["refusals"][0]
    assert found["default"] == "idm_calibrated"
    with pytest.raises(ValueError, match=r"no policy passes the gates, so none can be the default: stands: 0\.00 of"):
        default_of([stands], moments, idm)


def test_effort_is_the_share_of_epochs_but_one_at_least(options: Options, trainer: Trainer) -> None:
    assert main(replace(options, effort=1e-9)) == 0
    assert trainer.epochs == {1}
    assert main(options) == 0
    every = (PPO_PROFILES["fast"], GAIL_PROFILES["default"], ROLLOUTS["default"])
    assert trainer.epochs == {1, *(settings.epochs for _, settings in every)}


def test_second_time_nothing_is_done_but_the_report(
    options: Options, trainer: Trainer, measured: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    everything = replace(options, only="everything")
    assert main(everything) == 0
    first = list(measured)
    assert first[-1] == "report"
    last_choice = first.index("_forecast_development")
    assert all("development" in one for one in first[: last_choice + 1])  # validation is opened after it
    content = json.loads((options.out / "reproduced.json").read_text(encoding="utf-8"))
    assert content["about"]["recordings_validation"] == ["09"]
    assert content["about"]["name"] == "recordings"
    assert set(content["seconds"]) > set(STAGES)
    capsys.readouterr()
    done = (list(trainer.modules), list(trainer.folders))
    assert main(everything) == 0
    assert (trainer.modules, trainer.folders) == done
    assert measured == [*first, "report"]
    assert capsys.readouterr().out.count("was done before") == len(content["seconds"])
    assert json.loads((options.out / "reproduced.json").read_text(encoding="utf-8")) == content


def test_other_recordings_are_trained_on_anew(options: Options, trainer: Trainer) -> None:
    assert main(options) == 0
    record(options.recordings, "10")
    assert main(options) == 0
    assert trainer.modules == ["agents.gap", "agents.idm", "agents.orders"] * 2
    runs = {path.parent.name for path in (options.work / "runs").glob("*/ppo_3")}
    assert len(runs) == 2  # a training cannot go on with other data


def test_each_place_of_the_recordings_is_learned_from_and_its_own_map_told(
    options: Options, trainer: Trainer, tmp_path: Path, measured: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    map = own_map(tmp_path)
    own_recordings(options.recordings, map, "20", "21", "22")
    both = replace(options, map=("bendplatz", str(map)), only="everything")
    assert main(both) == 0
    assert "on maps: bendplatz, mine" in capsys.readouterr().out
    places = [str(options.work / "scenes" / f"{name}.npz") for name in ("bendplatz", "mine")]
    for told in trainer.told:
        if "agents.ppo" not in told:
            at = told.index("--scenes")
            assert told[at + 1 : at + 3] == places
        at = told.index("--map")
        assert told[at + 1 : at + 3] == ["bendplatz", str(map)]
    assert {told[0].partition(".")[0] for told in trainer.told} == {"agents", "imitation"}
    about = json.loads((options.out / "reproduced.json").read_text(encoding="utf-8"))["about"]
    assert about["maps"] == ["bendplatz", "mine"]
    assert about["recordings_validation"] == ["09"], "the paper's figures are of the first place"
    alone = Workspace(replace(options, map=(str(map),)))
    assert [place.name for place in alone.places] == ["mine"]
    assert alone.arguments(alone.places) == ["--scenes", places[1], "--map", str(map)]
    assert [place.name for place in Workspace(options).places] == ["bendplatz"], "the map that ships, where some lie"


def test_places_are_measured_each_by_itself(
    options: Options, trainer: Trainer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    map = own_map(tmp_path)
    own_recordings(options.recordings, map, "20", "21", "22")
    both = replace(options, map=("bendplatz", str(map)))
    assert main(both) == 0
    measurements = Measurements(Workspace(both))
    models = {name: Predictor.load(name) for name in ("idm", "constant_velocity")}
    monkeypatch.setattr(Measurements, "_models", lambda _: models)
    measurements._places()
    found = json.loads(measurements.result("places").read_text(encoding="utf-8"))
    assert list(found) == ["development", "validation"]
    for of_split in found.values():
        assert list(of_split) == ["bendplatz", "mine"]
        for place in of_split.values():
            rows = [row for row in place["rows"] if (row["population"], row["horizon"]) == ("recorded", 2.0)]
            assert [row["model"] for row in rows] == list(models)
            assert rows[1]["rmse"] < 0.3, "all drive steadily"
            assert all(f"| {name} |" in place_table(place["rows"]) for name in models)


def test_drivers_are_measured_alone_freely_and_within_the_limits_they_learned_in(
    options: Options, trainer: Trainer
) -> None:
    assert main(options) == 0
    measurements = Measurements(Workspace(options))
    measurements._replay("development")
    found = json.loads(measurements.result("replay_development").read_text(encoding="utf-8"))
    assert {key: len(rows) for key, rows in found.items()} == {"freely": 2 + 2 * 4, "within_limits": 1 + 3 * 4}
    assert not any(name.startswith("rollout_gradient") for name in found["freely"])
    for rows in found.values():
        for row in rows.values():
            assert row["at_4s"]["count"] >= row["at_10s"]["count"] > 0
    steady = found["freely"]["constant_velocity"]
    assert steady["at_4s"]["rmse"] < steady["at_10s"]["rmse"] < 0.5, "all drive steadily"


@pytest.mark.parametrize(("default", "timed"), [("idm_calibrated", "gail"), ("rollout_gradient", "rollout_gradient")])
def test_maneuvers_are_those_of_the_default_and_so_is_the_runtime_if_it_has_both_networks(
    default: str, timed: str, options: Options, trainer: Trainer, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(options) == 0
    (options.work / "default.json").write_text(json.dumps({"default": default}), encoding="utf-8")
    seen: list[str] = []

    def maneuvers(predictor: Predictor, *_: object) -> dict[str, object]:
        seen.append(predictor.name)
        return {}

    def runtime(options: RuntimeOptions) -> dict[str, object]:
        seen.append(Path(options.policy).stem)
        return {}

    monkeypatch.setattr(measurements, "maneuver_results", maneuvers)
    monkeypatch.setattr(measurements, "runtime_results", runtime)
    measured = Measurements(Workspace(options))
    measured._maneuvers()
    measured._runtime()
    assert seen == [default, timed]


def test_where_sumo_is_missing_maneuvers_are_not_driven(options: Options, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measurements, "find_spec", lambda _: None)
    Measurements(Workspace(options))._driven_gain()
    written = json.loads((options.out / "driven_gain_validation.json").read_text(encoding="utf-8"))
    assert written == {
        "split": "validation",
        "missing": {"sumo": "sumo is not installed: pip install -e '.[sumo]'"},
    }


def test_shipping_copies_the_policies_into_the_package(
    options: Options, trainer: Trainer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(reproduce, "POLICIES", package)
    assert main(options) == 0
    assert not list(package.iterdir())
    assert main(replace(options, ship=True)) == 0
    assert {path.name for path in package.iterdir()} == {"default", *(f"{name}.policy" for name in TRAINED)}
    chosen = json.loads((options.work / "default.json").read_text(encoding="utf-8"))
    assert (package / "default").read_text(encoding="utf-8") == f"{chosen['default']}\n"
    for name in TRAINED:
        shipped = (package / f"{name}.policy").read_bytes()
        assert shipped == (options.work / "forecasting" / f"{name}.policy").read_bytes()


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (KeyboardInterrupt(), 130, "interrupted; the same command goes on from here"),
        (KeyboardInterrupt(signal.SIGTERM), 143, "interrupted; the same command goes on from here"),
        (StageFailedError("the training in x ended with exit status 3", 3), 3, "error: the training in x ended"),
    ],
)
def test_job_that_ended_early_says_why_and_goes_on_from_there(
    error: BaseException,
    status: int,
    said: str,
    options: Options,
    trainer: Trainer,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def ends(*_: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(trainings, "run_trainings", ends)
        assert main(options) == status
    assert said in capsys.readouterr().err
    assert main(options) == 0
    assert trainer.modules == ["agents.gap", "agents.idm", "agents.orders"]
    assert len(trainer.folders) == len(MERITS)


@pytest.mark.parametrize(
    ("is_own", "said"),
    [
        (False, "sumo is not installed: pip install -e '.[sumo]'"),
        (True, "there is a network for Bendplatz only"),
    ],
)
def test_sumo_that_is_missing_ends_nothing(
    is_own: bool, said: str, options: Options, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    map = str(own_map(tmp_path))
    if is_own:
        own_recordings(options.recordings, Path(map), "20")

    monkeypatch.setattr(measurements, "find_spec", lambda _: None)
    assert Measurements(Workspace(replace(options, map=(map if is_own else "bendplatz",))))._sumo([]) == (
        [],
        {"sumo": said},
    )


def test_rounding_leaves_all_but_floats_as_it_is() -> None:
    content = {"a": [1, True, None, "x"], "b": (0.123456789, {"c": 123456789.0})}
    assert rounded(content) == {"a": [1, True, None, "x"], "b": [0.123457, {"c": 123457000.0}]}
