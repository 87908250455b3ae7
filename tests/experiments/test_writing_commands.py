"""Every command that writes: into a new folder, where nothing can be written, and with no space left on the disk.

The trainers are tried likewise in tests/agents/test_every_trainer.py.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tyro

import agents.export
import data.align.__main__ as align
import data.maps.__main__ as lane_maps
from agents import idm
from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_policy
from agents.rollouts import validation_run
from data import build
from data.sumo import generate
from experiments import demo
from experiments.bench import bench
from experiments.measure import crossing_order, driven_gain, forecast, gap, horizon, maneuver_gain, real, runtime
from experiments.measure import validation_run as closed_loop
from intersection_env.__main__ import main as intersection_env_main
from intersection_env.evaluation import intervals
from intersection_env.maps import __main__ as map_compiler
from intersection_env.maps.intersection import MAPS
from intersection_env.plots import __main__ as plots
from intersection_env.plots import animation
from intersection_env.policies.named import gap_decider
from tests.support.disk import full_disk
from tests.support.lane_maps import junction, write_commonroad_map
from tests.support.recordings import small_recordings
from tests.support.scenes import small_scenes


@dataclass(frozen=True)
class Given:
    """What commands read."""

    scenes: Path
    recordings: Path
    lanes: Path
    policy: Path


def measuring(module: Any, *arguments: str) -> Callable[[Given, Path], int]:
    """A command of experiments/ that measures scenes."""

    def call(given: Given, out: Path) -> int:
        told = [word.format(policy=given.policy) for word in arguments]
        where = [] if module is runtime else ["--scenes", str(given.scenes)]
        return int(module.main(tyro.cli(module.Options, args=[*where, *told, "--out", str(out)])))

    return call


COMMANDS: dict[str, tuple[str, Callable[[Given, Path], int]]] = {
    "maps": ("a.map", lambda given, out: map_compiler.main([str(MAPS / "t_junction.json"), str(out)])),
    "plots": ("a.png", lambda given, out: plots.main(["t_junction", "--out", str(out)])),
    "view": ("a.html", lambda given, out: intersection_env_main(["view", "t_junction", "--export", str(out)])),
    "build": (
        "a.npz",
        lambda given, out: build.main([str(given.recordings), "--map", "t_junction", "--out", str(out)]),
    ),
    "align": (
        "a.json",
        lambda given, out: align.main(["t_junction", str(given.recordings), "--least-cars", "99", "--out", str(out)]),
    ),
    "lane maps": ("a.json", lambda given, out: lane_maps.main([str(given.lanes), "--out", str(out)])),
    "sumo": ("", lambda given, out: generate.main(["--recording", "0", "--output", str(out)])),
    "export": (
        "a.onnx",
        lambda given, out: agents.export.main(["gap", "--network", "gap", "--to", "onnx", "--out", str(out)]),
    ),
    "idm": (
        "a.policy",
        lambda given, out: idm.main(
            ["--scenes", str(given.scenes), "--rounds", "1", "--every", "8", "--out", str(out)]
        ),
    ),
    "demo": (
        "",
        lambda given, out: demo.main(["--recordings", str(given.recordings), "--map", "t_junction", "--out", str(out)]),
    ),
    "bench": ("a.json", lambda given, out: bench.main(["--part", "environments", "--out", str(out)])),
    "crossing_order": ("", measuring(crossing_order, "--policies", "idm")),
    "forecast": ("", measuring(forecast)),
    "gap": ("", measuring(gap)),
    "horizon": ("", measuring(horizon, "--policies", "idm", "constant_velocity", "--forecasting")),
    "maneuver_gain": ("", measuring(maneuver_gain, "--moments", "2", "--limit", "10", "--policy", "idm")),
    "driven_gain": ("", measuring(driven_gain, "--moments", "2")),
    "closed_loop": ("", measuring(closed_loop, "--policies", "{policy}", "--gaps", "critical_gap")),
    "runtime": ("", measuring(runtime, "--scenes", "1")),
    "real": (
        "",
        lambda given, out: real.main(real.Options(given.recordings, ("t_junction",), out)),
    ),
}
"""By name: what to call the file, nothing where a folder is named; and the command, told what is given and where."""
SUMO_WRITES = ("sumo", "driven_gain")
"""Of them, those in which SUMO needs some space for itself."""
SLOW = ("runtime",)
"""Of them, what is tried in its own tests."""


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Given:
    folder = tmp_path_factory.mktemp("given")
    small_scenes("train", "development", each=2).save(folder / "scenes.npz")
    small_recordings(folder / "recordings", "t_junction")
    write_commonroad_map(folder / "lanes.xml", junction())
    driving_policy(gap_decider("gap"), DrivingNetwork(), {}).save(folder / "made.policy")
    return Given(folder / "scenes.npz", folder / "recordings", folder / "lanes.xml", folder / "made.policy")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "RESAMPLES", 20)
    monkeypatch.setattr(closed_loop, "WORLDS", 2)
    through = validation_run.validation_run
    monkeypatch.setattr(closed_loop, "validation_run", lambda *args, **named: through(*args, **named, steps=20))
    monkeypatch.setattr(idm, "POPULATION", 1)
    monkeypatch.setattr(animation, "DOTS_PER_INCH", 30)
    monkeypatch.setattr(animation, "FRAMES_PER_STEP", 1)
    monkeypatch.setattr(generate, "DURATION", 20.0)
    monkeypatch.setattr(generate, "WARM_UP", 0.0)
    monkeypatch.setattr(bench, "environment_rates", lambda: {"kept": 1})


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in SLOW])
def test_a_command_writes_into_a_new_folder(name: str, given: Given, tmp_path: Path) -> None:
    file, command = COMMANDS[name]
    out = tmp_path / "new" / "folder" / file
    assert command(given, out) == 0
    assert out.is_file() if file else any(out.iterdir())


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_cannot_write_says_so_before_it_works(
    name: str, given: Given, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, command = COMMANDS[name]
    (tmp_path / "taken").write_text("by a file")
    out = tmp_path / "taken" / "folder" / file
    assert command(given, out) == 1
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert str(out) in said.err
    assert f"cannot be written: {tmp_path / 'taken'} is no folder" in said.err
    assert said.out == ""


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in (*SLOW, *SUMO_WRITES)])
def test_a_full_disk_is_said_and_leaves_nothing_half_written(
    name: str, given: Given, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, command = COMMANDS[name]
    with full_disk(10):
        assert command(given, tmp_path / "out" / file) == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert f"{tmp_path / 'out'}" in lines[0]
    assert "cannot be written: " in lines[0]
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == []


def test_the_part_of_a_bench_goes_beside_what_is_there(given: Given, tmp_path: Path) -> None:
    out = tmp_path / "bench.json"
    out.write_text(json.dumps({"training": {"before": 1}}))
    assert COMMANDS["bench"][1](given, out) == 0
    assert json.loads(out.read_text()) == {"training": {"before": 1}, "environments": {"kept": 1}}


def test_a_device_is_not_replaced_by_a_file(given: Given, capsys: pytest.CaptureFixture[str]) -> None:
    device = Path("/dev/full")
    assert bench.main(["--part", "environments", "--out", str(device)]) == 1
    assert "/dev/full cannot be written: it is there, and no file" in capsys.readouterr().err
    assert device.is_char_device()
