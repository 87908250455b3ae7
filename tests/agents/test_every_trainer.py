"""What holds for each trainer: nothing of a run is lost, what is wrong is said, and a policy comes of it."""

from __future__ import annotations

import json
import runpy
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from agents.rollouts.policy_update import UpdateSettings
from agents.training.folder import CHECKPOINT, CONFIG, METRICS, decisive
from imitation.discriminator import DiscriminatorSettings
from intersection_env import ClosedLoopWorlds, Predictor
from intersection_env.policies.file import PolicyFile
from tests.support.disk import full_disk
from tests.support.own_place import own_scenes
from tests.support.scenes import small_scenes
from tests.support.trainings import (
    Trainer,
    cut_short,
    disk_full_from,
    files,
    killed,
    terminated,
    told_to_end_after,
    trainer_of,
)

TRAINERS = ("gap", "orders", "ppo", "gail", "rollout_gradient")
LONG = {"gap": 200, "gap, cyclic": 200, "orders": 200, "ppo": 60, "gail": 60, "rollout_gradient": 60}
"""Epochs that outlast three kills."""
OTHERS: dict[str, list[tuple[dict[str, Any], str]]] = {
    "gap": [({"batch": 128}, 'had "batch"'), ({"foes": "recorded"}, 'had "foes"')],
    "orders": [({"batch": 4}, 'had "batch"'), ({"policy": "gap"}, 'had "policy"')],
    "ppo": [({"update": UpdateSettings(clip=0.1)}, 'had "update"'), ({"gaps": ("gap",)}, 'had "gaps"')],
    "gail": [({"discriminator": DiscriminatorSettings()}, 'had "discriminator"')],
    "rollout_gradient": [({"huber": 1.0}, 'had "huber"'), ({"alone_share": 1.0}, 'had "alone_share"')],
}
"""Settings with which a run does not go on."""


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scenes") / "scenes.npz"
    small_scenes("train", "development", each=1).save(path)
    return path


@pytest.fixture(params=TRAINERS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def trainer(name: str, scenes: Path) -> Trainer:
    return trainer_of(name, scenes)


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Scenes of a place of one's own, and their map."""
    return own_scenes(tmp_path_factory.mktemp("own"))


@pytest.fixture
def of_two_places(name: str, scenes: Path, own: tuple[Path, Path]) -> Trainer:
    return trainer_of(name, scenes, own[0], map=own[1])


WITH_SCHEDULES = pytest.mark.parametrize("name", [*TRAINERS, "gap, cyclic"])


@WITH_SCHEDULES
def test_run_killed_three_times_ends_like_an_unbroken_one(trainer: Trainer, name: str, tmp_path: Path) -> None:
    wanted = trainer.train(tmp_path / "unbroken", epochs=LONG[name])
    broken = replace(trainer.settings, run=tmp_path / "broken", epochs=LONG[name])
    killed(trainer.main, broken)
    assert trainer.main(replace(broken, resume=True)) == 0
    assert trainer.outcome(broken.run) == wanted


@WITH_SCHEDULES
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_run_told_to_end_by_a_signal_ends_like_an_unbroken_one(
    trainer: Trainer, number: signal.Signals, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trainer.train(tmp_path / "unbroken")
    broken = replace(trainer.settings, run=tmp_path / "broken")
    with told_to_end_after(4, number):
        assert trainer.main(broken) == status
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert f"--resume goes on from {broken.run}" in capsys.readouterr().err
    assert torch.load(broken.run / CHECKPOINT)["epoch"] == 5, "the epoch under way is finished first"
    assert trainer.main(replace(broken, resume=True)) == 0
    assert trainer.outcome(broken.run) == wanted


def test_a_process_that_got_sigterm_goes_on_from_its_last_epoch(
    trainer: Trainer, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Long before a checkpoint is due."""
    settings = replace(trainer.settings, run=tmp_path / "run", epochs=LONG[name], checkpoint_every=10_000)
    assert terminated(trainer.main, settings) == 143
    left = torch.load(settings.run / CHECKPOINT)["epoch"]
    assert 0 < left < LONG[name]
    capsys.readouterr()
    with told_to_end_after(left + 1):
        assert trainer.main(replace(settings, resume=True)) == 130
    assert f"--resume {settings.run}: goes on after epoch {left} of {LONG[name]}" in capsys.readouterr().out
    epochs = [json.loads(line)["epoch"] for line in (settings.run / METRICS).read_text().splitlines()]
    assert epochs == list(range(1, left + 3))


def test_resuming_where_nothing_is_says_so(
    trainer: Trainer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = replace(trainer.settings, run=tmp_path / "run", epochs=1, resume=True)
    assert trainer.main(settings) == 0
    assert f"--resume {settings.run}: no checkpoint there yet: begins anew" in capsys.readouterr().out


def test_the_seed_decides_the_result(trainer: Trainer, tmp_path: Path) -> None:
    one, two, other = (trainer.train(tmp_path / str(number), seed=seed) for number, seed in enumerate((0, 0, 1)))
    assert one == two
    assert one[0] != other[0]


@pytest.mark.parametrize("name", ["ppo", "gail"])
def test_threads_change_no_byte(trainer: Trainer, tmp_path: Path) -> None:
    one, two = (trainer.train(tmp_path / str(count), threads=count) for count in (1, 2))
    assert one == two


def test_main_writes_a_policy_that_loads_and_a_line_an_epoch(
    trainer: Trainer, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = replace(trainer.settings, run=tmp_path / "run")
    assert trainer.main(settings) == 0
    path = settings.run / trainer.policy
    assert f"written: {path}, in " in capsys.readouterr().out
    policy, about = Predictor.load(path).policy, trainer.about(settings.run)
    assert about["made_by"] == trainer.command
    assert about["settings"] == decisive(settings)
    assert (policy.spread is not None) == (policy.order_network is not None) == (name == "orders"), (
        "of another's drivers"
    )
    ClosedLoopWorlds(gap=path if policy.gap_network else "sumo").reset(0)
    rows = [json.loads(line) for line in (settings.run / METRICS).read_text().splitlines()]
    assert [row["epoch"] for row in rows] == list(range(1, 9))
    (closer,) = {"accuracy", "validation", "development"} & (rows[2].keys() - rows[0].keys())
    assert [closer in row for row in rows] == [False, False, True, False, False, True, False, True]


def test_run_over_two_places_interrupted_by_ctrl_c_ends_like_an_unbroken_one(
    of_two_places: Trainer, trainer: Trainer, tmp_path: Path
) -> None:
    """One of them on a map of one's own; PPO's worlds and GAIL's are 4 and 8, in two shares."""
    wanted = of_two_places.train(tmp_path / "unbroken")
    broken = replace(of_two_places.settings, run=tmp_path / "broken")
    with told_to_end_after(epoch=4):
        assert of_two_places.main(broken) == 130
    assert of_two_places.main(replace(broken, resume=True)) == 0
    assert of_two_places.outcome(broken.run) == wanted
    assert trainer.train(tmp_path / "one place")[0] != wanted[0]
    about = of_two_places.about(broken.run)
    assert about.get("maps", about.get("data", {}).get("maps")) == ["bendplatz", "mine"]


def test_a_run_does_not_go_on_without_one_of_its_places_or_with_another_map(
    of_two_places: Trainer, trainer: Trainer, own: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    of_two_places.train(run, epochs=1)
    assert trainer.main(replace(trainer.settings, run=run, epochs=1, resume=True)) == 1
    assert 'had "data"' in capsys.readouterr().err
    if hasattr(of_two_places.settings, "scenes"):
        without_map = replace(of_two_places.settings, map=(), run=run, epochs=1, resume=True)
        assert of_two_places.main(without_map) == 1
        error = capsys.readouterr().err
        assert f'{own[0]}: its map "mine" does not ship; give it: --map' in error


@pytest.mark.parametrize("name", ["ppo", "gail"])
def test_worlds_that_places_cannot_share_equally_are_shared_all_the_same(
    of_two_places: Trainer, tmp_path: Path
) -> None:
    one, two = (of_two_places.train(tmp_path / str(count), worlds=5, epochs=2, threads=count) for count in (1, 2))
    assert one == two


@pytest.mark.parametrize("name", ["ppo", "gail", "rollout_gradient"])
def test_figures_go_to_tensorboard_if_it_is_there(
    trainer: Trainer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trainer.train(tmp_path / "with", epochs=1, tensorboard=True)
    assert any(file.startswith("events.out.tfevents") for file in files(tmp_path / "with"))
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    settings = replace(trainer.settings, run=tmp_path / "without", epochs=1)
    assert trainer.main(replace(settings, tensorboard=True)) == 1
    assert "pip install 'intersection_env[tensorboard]'" in capsys.readouterr().err
    assert trainer.main(settings) == 0


def test_a_run_goes_on_with_its_own_settings_and_data_only(
    trainer: Trainer, name: str, scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trainer.train(tmp_path / "run")
    small_scenes("train", "development", "validation", each=1).save(tmp_path / "more.npz")
    capsys.readouterr()
    others = [({"seed": 1}, 'had "seed" = 0, not 1'), *OTHERS[name]]
    if hasattr(trainer.settings, "scenes"):
        others.append(({"scenes": (tmp_path / "more.npz",)}, 'had "data"'))
    for change, message in [({"resume": False}, "holds a run already"), *others]:
        assert trainer.main(replace(trainer.settings, run=tmp_path / "run", **({"resume": True} | change))) == 1
        assert message in capsys.readouterr().err
    assert trainer.outcome(tmp_path / "run") == wanted


def test_checkpoint_cut_short_is_named_and_left_as_it_is(
    trainer: Trainer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trainer.train(tmp_path)
    metrics, left = (tmp_path / METRICS).read_bytes(), cut_short(tmp_path)
    assert trainer.main(replace(trainer.settings, run=tmp_path, resume=True)) == 1
    assert f"error: {tmp_path / CHECKPOINT} is damaged" in capsys.readouterr().err
    assert (tmp_path / CHECKPOINT).read_bytes() == left
    assert (tmp_path / METRICS).read_bytes() == metrics


def test_full_disk_leaves_the_previous_checkpoint(
    trainer: Trainer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trainer.train(tmp_path / "unbroken")
    settings = replace(trainer.settings, run=tmp_path / "run")
    with disk_full_from(epoch=6):
        assert trainer.main(settings) == 1
    assert f"error: {settings.run / CHECKPOINT} cannot be written" in capsys.readouterr().err
    assert files(settings.run) == {CONFIG, METRICS, CHECKPOINT}, "something half-written is left"
    assert torch.load(settings.run / CHECKPOINT)["epoch"] == 3
    assert trainer.main(replace(settings, resume=True)) == 0
    assert trainer.outcome(settings.run) == wanted


def test_full_disk_at_the_policy_file_is_named(
    trainer: Trainer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = replace(trainer.settings, run=tmp_path / "run")
    through = PolicyFile.save

    def fill(self: PolicyFile, path: Path) -> None:
        with full_disk(1000):
            through(self, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PolicyFile, "save", fill)
        assert trainer.main(settings) == 1
    assert capsys.readouterr().err.startswith("error: ")
    assert files(settings.run) == {CONFIG, METRICS, CHECKPOINT}
    assert trainer.main(replace(settings, resume=True)) == 0
    Predictor.load(settings.run / trainer.policy)


@pytest.mark.filterwarnings("ignore:.*found in sys.modules after import of package:RuntimeWarning")  # it is run anew
def test_usage_names_the_command(
    trainer: Trainer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = trainer.command.removeprefix("python -m ")
    monkeypatch.setattr(sys, "argv", [module, "--help"])
    with pytest.raises(SystemExit):
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    assert capsys.readouterr().out.startswith(f"usage: {trainer.command} ")
