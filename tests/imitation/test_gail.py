"""The driver's training by GAIL: what it starts from, what is paid, and that bad input is named."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import tyro
from tensordict import TensorDict
from torch import nn

import agents.ppo
import imitation.closer_look
from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network
from agents.rollouts.policy_update import PolicyUpdate
from agents.training.folder import CHECKPOINT, METRICS, RunFolder, file_hash, state_hash
from imitation.cloning import Cloning, Examples
from imitation.discriminator import Discriminator, DiscriminatorSettings
from imitation.expert import expert_steps
from imitation.gail import PROFILES, GailSettings, begun_with, main, start_of, train_driver
from imitation.replay_error import ReplayError, replay_error
from intersection_env import Predictor, Scenes
from intersection_env.constants import ACCELERATION, LEAD_RANGE, STEPS
from intersection_env.evaluation.empty_road import EmptyRoad, empty_road
from intersection_env.evaluation.gates import LEAST_SPEED
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import POLICIES
from intersection_env.scenes.file import read_scenes_file, write_scenes_file
from intersection_env.scenes.scene import Track
from tests.support.networks import weights
from tests.support.scenes import small_scenes
from tests.support.trainings import TINY_GAIL as TINY
from tests.support.trainings import TINY_PPO, cut_short, outcome, refused


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train", "development")


@pytest.fixture(scope="module")
def tiny(scenes: Scenes, tmp_path_factory: pytest.TempPathFactory) -> GailSettings:
    """A tiny training on a file of small scenes."""
    path = tmp_path_factory.mktemp("scenes") / "scenes.npz"
    scenes.save(path)
    return replace(TINY, scenes=(path,))


@pytest.fixture(scope="module")
def ppo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of a tiny training by PPO."""
    torch.set_num_threads(1)
    run = tmp_path_factory.mktemp("ppo") / "run"
    agents.ppo.train_driver(replace(TINY_PPO, run=run, epochs=1), RunFolder.begin(run, {}, "", False), progress=False)
    return run


def test_training_starts_from_ppo_and_first_teaches_the_value_alone(
    tiny: GailSettings, scenes: Scenes, ppo: Path
) -> None:
    start = start_of(ppo)
    before = weights(start.policy), weights(start.value)
    early = train_driver(scenes, start, replace(tiny, epochs=2, value_epochs=2), progress=False)
    assert weights(early.policy) == before[0]
    assert weights(early.value) != before[1]
    late = train_driver(scenes, start, replace(tiny, epochs=3, value_epochs=2), progress=False)
    assert weights(late.policy) != before[0]
    assert (weights(start.policy), weights(start.value)) == before, "the start itself was trained"


def test_training_may_start_from_another_driver_with_the_value_network_of_ppo(ppo: Path) -> None:
    start = start_of(ppo)
    begun = begun_with("rollout_gradient", start)
    assert weights(begun.policy) == weights(driving_network(Predictor.load("rollout_gradient").policy))
    assert weights(begun.value) == weights(start.value)
    assert weights(begun_with("rollout_gradient", None).policy) == weights(begun.policy)
    with pytest.raises(ValueError, match='drives by "idm" and holds no driving network'):
        begun_with("idm_calibrated", start)


def test_reward_is_the_discriminators_and_the_worlds_own_counts_nothing(
    tiny: GailSettings, scenes: Scenes, monkeypatch: pytest.MonkeyPatch
) -> None:
    rewards = 0
    through = PolicyUpdate.advantages

    def spy(self: PolicyUpdate, rollout: TensorDict) -> TensorDict:
        nonlocal rewards
        torch.testing.assert_close(
            rollout["next", "reward"].squeeze(-1), 0.5 * rollout["observation"][..., Driving.SPEED]
        )
        rewards += 1
        return through(self, rollout)

    monkeypatch.setattr(PolicyUpdate, "advantages", spy)
    monkeypatch.setattr(Discriminator, "reward", lambda self, features: features[..., Driving.SPEED])
    train_driver(scenes, None, replace(tiny, epochs=2, reward_scale=0.5), progress=False)
    assert rewards == 2


@pytest.mark.parametrize("bootstrap", [False, True])
def test_nothing_follows_an_end_unless_it_is_bootstrapped(
    tiny: GailSettings, scenes: Scenes, monkeypatch: pytest.MonkeyPatch, bootstrap: bool
) -> None:
    """At a track's end the value's target is the last reward alone, or that and the value of what was seen last."""
    ends = 0
    through = PolicyUpdate.advantages

    def spy(self: PolicyUpdate, rollout: TensorDict) -> TensorDict:
        nonlocal ends
        samples, following = through(self, rollout), rollout["next"]
        over = following["done"].reshape(-1)
        ends += int(over.sum())
        beyond = self.settings.gamma * following["state_value"].reshape(-1)[over] if bootstrap else 0.0
        wanted = following["reward"].reshape(-1)[over] + beyond
        blamed = following["terminated"].reshape(-1)[over] if bootstrap else torch.zeros_like(wanted, dtype=torch.bool)
        torch.testing.assert_close(samples["value_target"].reshape(-1)[over][~blamed], wanted[~blamed])
        return samples

    monkeypatch.setattr(PolicyUpdate, "advantages", spy)
    train_driver(scenes, None, replace(tiny, epochs=6, bootstrap_ends=bootstrap), progress=False)
    assert ends > 5


def test_a_checkpoint_that_crawls_is_chosen_only_if_all_do(
    tiny: GailSettings, scenes: Scenes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of four checkpoints the second predicts best, and the third best of those that do not crawl."""
    errors, least = [5.0, 1.0, 2.0, 3.0], [0.1, 0.4, 0.5, 0.9]
    looks = iter([*errors, *errors])
    monkeypatch.setattr(imitation.closer_look, "distance_error", lambda *_: next(looks))
    for shares, epoch in ((least, 3), ([0.1] * 4, 2)):
        alone = iter([EmptyRoad(share, 1.0, "", 1) for share in shares])
        monkeypatch.setattr(imitation.closer_look, "empty_road", lambda *_, found=alone, **__: next(found))
        folder = RunFolder.begin(tmp_path / str(epoch), {}, "", False)
        train_driver(scenes, None, replace(tiny, epochs=4, checkpoint_every=1), folder, progress=False)
        assert torch.load(tmp_path / str(epoch) / CHECKPOINT)["best"]["epoch"] == epoch


def test_policy_is_drawn_to_the_recorded_drivers_and_on_an_empty_road_to_ppo(
    tiny: GailSettings, scenes: Scenes, ppo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Sequence[Examples]] = []

    class Spy(Cloning):
        def __init__(self, policy: DrivingNetwork, examples: Sequence[Examples], generator: torch.Generator) -> None:
            super().__init__(policy, examples, generator)
            asked.append(examples)

    monkeypatch.setattr(imitation.gail, "Cloning", Spy)
    start, settings = start_of(ppo), replace(tiny, epochs=1, kept=0.25)
    train_driver(scenes, start, settings, progress=False)
    train_driver(scenes, None, settings, progress=False)
    (recorded, alone), (only,) = asked
    steps = expert_steps(scenes, "train")
    for one in (recorded, only):
        np.testing.assert_array_equal(one.observation, steps.observation)
        np.testing.assert_array_equal(one.acceleration, steps.acceleration)
    assert alone.drawn == (recorded.drawn + alone.drawn) / 4
    assert only.drawn == recorded.drawn + alone.drawn
    assert (alone.observation[:, Driving.LEAD_DISTANCE] == LEAD_RANGE).all()
    with torch.no_grad():
        torch.testing.assert_close(alone.acceleration, ACCELERATION * torch.tanh(start.policy(alone.observation)))


def test_discriminator_rests_above_the_accuracy_asked_for(tiny: GailSettings, scenes: Scenes, tmp_path: Path) -> None:
    after = {}
    for most in (-1.0, 1.0):
        for epochs in (1, 3):
            run = tmp_path / f"{most} {epochs}"
            settings = replace(
                tiny, epochs=epochs, discriminator=DiscriminatorSettings(passes=2, minibatches=1, most_accuracy=most)
            )
            train_driver(scenes, None, settings, RunFolder.begin(run, {}, "", False), progress=False)
            after[most, epochs] = state_hash(torch.load(run / CHECKPOINT)["discriminator"])
    assert after[-1.0, 1] == after[-1.0, 3]
    assert after[1.0, 1] != after[1.0, 3]


def test_the_policy_drives_by_the_best_network_and_says_what_it_learned_from(
    tiny: GailSettings, scenes: Scenes, ppo: Path, tmp_path: Path
) -> None:
    settings = replace(tiny, run=tmp_path / "run", ppo=ppo)
    assert main(settings) == 0
    policy, shipped = PolicyFile.read(tmp_path / "run" / "gail.policy"), PolicyFile.read(POLICIES / "gap.policy")
    assert policy.driver == "network"
    assert policy.gap_network is not None
    assert shipped.gap_network is not None
    assert policy.driving_network is not None
    np.testing.assert_array_equal(policy.gap_network.layers[0][0], shipped.gap_network.layers[0][0])
    best = torch.load(tmp_path / "run" / CHECKPOINT)["best"]
    np.testing.assert_array_equal(policy.driving_network.layers[1][0], best["policy"]["second.weight"])
    rows = [json.loads(line) for line in (settings.run / METRICS).read_text().splitlines()]
    chosen = min(
        (row["empty_road"]["least"] < LEAST_SPEED, row["predicted"], row["epoch"]) for row in rows if "predicted" in row
    )
    assert (best["crawls"], best["error"], best["epoch"]) == chosen
    looked = [row for row in rows if "predicted" in row]
    assert all(set(row["until_last_seen"]) >= {"rmse", "mad", "bias", "recorded_speed_behind"} for row in looked)
    assert all(set(row["empty_road"]) == {"least", "mean"} for row in looked)
    assert set(policy.about["until_last_seen"]) == {"gail", "constant_velocity"}
    assert policy.about["empty_road"] == empty_road(Predictor(policy, "gail"), maps=[scenes.intersection]).figures()
    assert policy.about["maps"] == ["bendplatz"]
    assert policy.about["sha256"] == {
        "scenes": [file_hash(*settings.scenes)],
        "ppo": state_hash(start_of(ppo).state_dict()),
    }
    figures = replay_error(driving_network(policy), scenes, "development")
    assert ReplayError(**policy.about["development"]).rmse == pytest.approx(figures.rmse, abs=1e-5)


def test_gaps_in_the_replays_can_be_decided_by_a_policy(tiny: GailSettings, tmp_path: Path) -> None:
    for gap in ("recording", "gap"):
        assert main(replace(tiny, run=tmp_path / gap, gap=gap, epochs=2)) == 0
    assert outcome(tmp_path / "recording") != outcome(tmp_path / "gap")
    about = PolicyFile.read(tmp_path / "gap" / "gail.policy").about
    assert set(about["sha256"]) == {"scenes", "gap"}


def test_command_line_reaches_nested_settings() -> None:
    arguments = ["default", "--ppo", "None", "--update.passes", "3", "--discriminator.noise", "0.2", "--resume"]
    settings = tyro.extras.overridable_config_cli(PROFILES, args=arguments)
    assert settings.ppo is None
    assert (settings.update.passes, settings.update.minibatches) == (3, 8)
    assert settings.discriminator == DiscriminatorSettings(noise=0.2)
    assert settings.resume


# Bad input


@pytest.mark.parametrize(("there", "missing"), [("development", "train"), ("train", "development")])
def test_scenes_without_a_split_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], there: str, missing: str
) -> None:
    small_scenes(there).save(tmp_path / "a.npz")
    error = refused(main, replace(TINY, scenes=(tmp_path / "a.npz",), run=tmp_path / "run"), capsys)
    assert str(tmp_path / "a.npz") in error
    assert f'no scene of split "{missing}"' in error


def test_scenes_in_which_nobody_can_act_are_refused(
    scenes: Scenes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bicycles = tuple(
        replace(scene, tracks=tuple(replace(track, road_user="bicycle") for track in scene.tracks)) for scene in scenes
    )
    replace(scenes, scenes=bicycles).save(tmp_path / "a.npz")
    error = refused(main, replace(TINY, scenes=(tmp_path / "a.npz",), run=tmp_path / "run"), capsys)
    assert f'{tmp_path / "a.npz"}, split "train"' in error
    assert "bicycles" in error


def test_scenes_in_which_nobody_can_be_watched_for_ten_seconds_are_refused(
    scenes: Scenes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def late(track: Track) -> Track:
        return replace(track, observed=np.arange(len(track.position)) >= len(track.position) - STEPS - 1)

    brief = tuple(
        replace(scene, tracks=tuple(late(track) for track in scene.tracks)) if scene.split == "development" else scene
        for scene in scenes
    )
    replace(scenes, scenes=brief).save(tmp_path / "a.npz")
    error = refused(main, replace(TINY, scenes=(tmp_path / "a.npz",), run=tmp_path / "run"), capsys)
    assert 'split "development": nobody is recorded for more than 10 s' in error


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda header: header | {"dt": 0.1}, "dt is 0.1 s, this package reads 0.2 s"),
        (lambda header: header | {"map": header["map"] | {"checksum": "00000000"}}, "checksum 00000000"),
        (lambda header: header | {"version": 2}, '"version" is 2'),
    ],
)
def test_scenes_made_for_something_else_are_refused(
    tiny: GailSettings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    spoil: Callable[[dict[str, Any]], dict[str, Any]],
    message: str,
) -> None:
    header, arrays = read_scenes_file(*tiny.scenes)
    write_scenes_file(tmp_path / "a.npz", spoil(header), arrays)
    error = refused(main, replace(tiny, scenes=(tmp_path / "a.npz",), run=tmp_path / "run"), capsys)
    assert str(tmp_path / "a.npz") in error
    assert message in error


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scenes": (Path("missing.npz"),)}, "missing.npz"),
        ({"ppo": Path("missing")}, "missing holds no checkpoint to begin with"),
        ({"gap": "idm"}, 'the policy "idm" has no gap network'),
        ({"decider": "idm"}, 'the policy "idm" has no gap network'),
        ({"decider": "missing.policy"}, "missing.policy"),
        ({"policy": "missing.policy"}, "missing.policy"),
        ({"policy": "gap"}, "holds no driving network"),
        ({"kept": 1.0}, "kept is 1.0; wanted a share from 0 to below 1"),
    ],
)
def test_bad_settings_are_named_with_status_1(
    tiny: GailSettings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    settings: dict[str, Any],
    message: str,
) -> None:
    assert message in refused(main, replace(tiny, run=tmp_path / "run", **settings), capsys)


def test_start_that_is_none_of_ppo_is_refused(
    tiny: GailSettings, ppo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = tmp_path / "start"
    settings = replace(tiny, run=tmp_path / "run", ppo=start)
    start.mkdir()
    (start / CHECKPOINT).write_bytes((ppo / CHECKPOINT).read_bytes())
    left = cut_short(start)
    assert f"{start / CHECKPOINT} is damaged" in refused(main, settings, capsys)
    assert (start / CHECKPOINT).read_bytes() == left
    other_kind: list[Any] = [{"network": {}, "epoch": 1}, {"driver": nn.Linear(2, 2).state_dict()}, [1], {"driver": 3}]
    for state in other_kind:
        torch.save(state, start / CHECKPOINT)
        assert f"{start / CHECKPOINT} is of no training by python -m agents.ppo" in refused(main, settings, capsys)
