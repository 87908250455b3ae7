"""Scenes on a map of one's own go through every command that takes scenes, alone and beside those that ship."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tyro

from agents import idm
from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_policy
from agents.rollouts import validation_run
from data.describe import statistics
from experiments.measure import crossing_order, gap, horizon, maneuver_gain, sumo_errors
from experiments.measure import validation_run as closed_loop
from intersection_env.evaluation import intervals
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import gap_decider
from tests.support.own_place import own_scenes
from tests.support.scenes import small_scenes

SCORERS: dict[str, tuple[Any, str]] = {
    "crossing_order": (crossing_order, "order_development"),
    "horizon": (horizon, "horizon_development"),
    "gap": (gap, "gap_development"),
    "maneuver_gain": (maneuver_gain, "maneuvers_development"),
    "closed_loop": (closed_loop, "closed_loop"),
}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return own_scenes(tmp_path_factory.mktemp("own"), *(f"{number:02d}" for number in range(8)))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("small") / "small.npz"
    small_scenes("train", "development", each=1).save(path)
    return path


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 20)
    monkeypatch.setattr(closed_loop, "WORLDS", 2)
    through = validation_run.validation_run
    monkeypatch.setattr(closed_loop, "validation_run", lambda *args, **named: through(*args, **named, steps=20))
    monkeypatch.setattr(idm, "POPULATION", 1)
    driving_policy(gap_decider("gap"), DrivingNetwork(), {}).save(tmp_path / "made.policy")


def options_of(name: str, *arguments: str) -> Any:
    return tyro.cli(SCORERS[name][0].Options, args=arguments)


def special(name: str, folder: Path) -> list[str]:
    """Options with which a scorer is quick."""
    made = str(folder / "made.policy")
    return {
        "crossing_order": ["--policies", "idm"],
        "horizon": ["--policies", "idm", "constant_velocity"],
        "maneuver_gain": ["--moments", "2", "--limit", "10", "--policy", "idm"],
        "closed_loop": ["--policies", made, "--gaps", "critical_gap"],
    }.get(name, [])


@pytest.mark.parametrize("name", SCORERS)
def test_scorer_takes_own_scenes_and_those_of_two_places(
    name: str, own: tuple[Path, Path], small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes, map = map_and_scenes(own)
    module, result = SCORERS[name]
    common = ["--out", str(tmp_path), *special(name, tmp_path)]
    assert module.main(options_of(name, "--scenes", scenes, "--map", map, *common)) == 0
    alone = (tmp_path / f"{result}.json").read_bytes()
    assert module.main(options_of(name, "--scenes", str(small), scenes, "--map", map, *common)) == 0
    if name == "closed_loop":
        assert (tmp_path / "closed_loop_mine.json").read_bytes() == alone
        assert (tmp_path / "closed_loop_bendplatz.json").read_bytes() != alone
    else:
        assert (tmp_path / f"{result}.json").read_bytes() != alone
    capsys.readouterr()
    assert module.main(options_of(name, "--scenes", scenes, *common)) == 1
    assert f'error: {scenes}: its map "mine" does not ship; give it: --map' in capsys.readouterr().err


def map_and_scenes(own: tuple[Path, Path]) -> tuple[str, str]:
    return str(own[0]), str(own[1])


@pytest.mark.parametrize("name", SCORERS)
def test_scorer_measures_the_papers_place_unless_told_otherwise(name: str) -> None:
    assert options_of(name).scenes == (Path("bendplatz"),)
    assert options_of(name, "--scenes", "bendplatz", "t_junction").scenes == (Path("bendplatz"), Path("t_junction"))


def test_statistics_describe_each_place(
    own: tuple[Path, Path], small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes, map = map_and_scenes(own)
    assert statistics.main([str(small), scenes, "--map", map]) == 0
    printed = capsys.readouterr().out
    assert f"{small}, map bendplatz\n---" in printed
    assert f"{scenes}, map mine\n---" in printed
    assert printed.count("traffic in scenes") == 2


def test_idm_is_calibrated_on_own_scenes_and_on_several_places(
    own: tuple[Path, Path], small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes, map = map_and_scenes(own)
    counts: list[int] = []
    for files, maps in (
        ([scenes], ["mine"]),
        ([str(small), scenes], ["bendplatz", "mine"]),
        ([str(small)], ["bendplatz"]),
    ):
        out = tmp_path / f"{len(counts)}.policy"
        told = ["--scenes", *files, *(["--map", map] if "mine" in maps else [])]
        assert idm.main([*told, "--rounds", "1", "--every", "8", "--out", str(out)]) == 0
        counts.append(int(capsys.readouterr().out.split(" moments to learn from")[0]))
        data = PolicyFile.read(out).about["data"]
        assert data["maps"] == maps
        assert len(data["sha256"]) == len(maps)
    assert counts[1] == counts[0] + counts[2]


def test_sumo_as_a_predictor_knows_bendplatz_alone(
    own: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes, map = own

    def refuse(traffics: Any) -> None:
        assert {one.intersection.name for one in traffics} == {"mine"}
        raise ValueError("predicts Bendplatz")

    monkeypatch.setattr(sumo_errors, "predictions", refuse)
    assert sumo_errors.main(sumo_errors.Options(scenes=(scenes,), map=(str(map),))) == 1
    assert "error: predicts Bendplatz" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["agents.gap.train", "agents.idm", "imitation.gail"])
def test_learner_learns_from_all_places_that_ship_unless_told_otherwise(name: str) -> None:
    module = importlib.import_module(name)
    profiles: dict[str, tuple[str, Any]] = getattr(module, "PROFILES", {})
    for _, settings in profiles.values():
        assert [str(path) for path in settings.scenes] == [str(path) for path in module.ALL_SCENES]


def test_nobody_is_scored_on_what_is_undefined(own: tuple[Path, Path], tmp_path: Path) -> None:
    """Where all yielders go, there is no balanced accuracy; the file holds null, as JSON knows no NaN."""
    scenes, map = map_and_scenes(own)
    assert gap.main(options_of("gap", "--scenes", scenes, "--map", map, "--out", str(tmp_path))) == 0
    read: Callable[[str], Any] = lambda text: pytest.fail(f"{text} in a results file")  # noqa: E731
    json.loads((tmp_path / "gap_development.json").read_text(encoding="utf-8"), parse_constant=read)
