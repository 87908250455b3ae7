"""The driver's training by GAIL: expert, discriminator and error against plain sums; nothing of a run is lost."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import tyro
from tensordict import TensorDict
from torch import Tensor, nn

import agents.ppo
import imitation.tracks
from agents.networks.driving import Driver, DrivingNetwork
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.training.folder import CHECKPOINT, METRICS, RunFolder, decisive, file_hash, state_hash
from imitation.discriminator import Discriminator, DiscriminatorLoss, DiscriminatorSettings
from imitation.expert import ExpertSteps, expert_steps
from imitation.gail import PROFILES, GailSettings, main, start_of, train_driver
from imitation.replay_error import ReplayError, replay_error
from intersection_env import ClosedLoopWorlds, Predictor, ReplayWorlds, Scenes
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from intersection_env.scenes.file import read_scenes_file, write_scenes_file
from intersection_env.scenes.scene import Track
from intersection_env.worlds.recorded_tracks import steps_to_act
from tests.agents.test_ppo import TINY as TINY_PPO
from tests.agents.test_ppo import weights
from tests.support.training import cut_short, files, full_disk, killed, outcome, small_scenes

TINY = GailSettings(
    ppo=None,
    worlds=8,
    steps=16,
    epochs=8,
    value_epochs=2,
    update=UpdateSettings(passes=2, minibatches=1),
    discriminator=DiscriminatorSettings(updates=2),
    threads=1,
    checkpoint_every=3,
)
SCALE = 6.0  # m/s², of an action of 1
HORIZON = 50


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train", "development")


@pytest.fixture(scope="module")
def tiny(scenes: Scenes, tmp_path_factory: pytest.TempPathFactory) -> GailSettings:
    """A tiny training on a file of small scenes."""
    path = tmp_path_factory.mktemp("scenes") / "scenes.npz"
    scenes.save(path)
    return replace(TINY, scenes=path)


@pytest.fixture(scope="module")
def ppo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of a tiny training by PPO."""
    torch.set_num_threads(1)
    run = tmp_path_factory.mktemp("ppo") / "run"
    agents.ppo.train_driver(replace(TINY_PPO, run=run, epochs=1), RunFolder.begin(run, {}, "", False), progress=False)
    return run


# The expert


@pytest.fixture(scope="module")
def expert(scenes: Scenes) -> ExpertSteps:
    return expert_steps(scenes, "train")


def test_expert_steps_are_those_of_the_recorded_tracks(scenes: Scenes, expert: ExpertSteps) -> None:
    worlds = ReplayWorlds(scenes, split="train")
    tracks = [track for scene in worlds.tracks.scenes for track in scene.tracks]
    assert np.unique(expert.track).tolist() == worlds.tracks.actors.tolist()
    assert len(expert) == sum(steps_to_act(tracks[index]) for index in worlds.tracks.actors)
    for index in worlds.tracks.actors:
        track = tracks[index]
        recorded = slice(int(np.argmax(track.observed)), -1)
        own = expert.track == index
        np.testing.assert_array_equal(expert.observation[own, Driving.SPEED], track.speed[recorded])
        rises = np.diff(track.speed[recorded.start :].astype(np.float64)) / 0.2
        np.testing.assert_allclose(expert.acceleration[own], rises, atol=1e-4)


def test_expert_steps_are_what_one_world_shows_of_each_track(scenes: Scenes, expert: ExpertSteps) -> None:
    worlds = ReplayWorlds(scenes, split="train", autoreset="off")
    worlds.reset(0)
    for index in worlds.tracks.actors[::7]:
        worlds.start(0, int(index))
        own = np.flatnonzero(expert.track == index)
        for row in own:
            np.testing.assert_array_equal(worlds.expert_observation[0], expert.observation[row])
            assert worlds.expert_acceleration[0] == expert.acceleration[row]
            worlds.action[0] = worlds.expert_acceleration[0] / SCALE
            worlds.step()
        assert worlds.truncated[0]


def test_expert_sees_the_gap_decisions_of_the_recording(scenes: Scenes, expert: ExpertSteps) -> None:
    delta = expert.observation[:, Driving.ENTERS]
    assert set(np.unique(delta)) == {0.0, 1.0}
    assert (expert_steps(scenes, "train", "critical_gap").observation[:, Driving.ENTERS] != delta).any()


# The error in the replays


class Watched(ReplayWorlds):
    """Replay worlds that can be asked what the recorded drivers do."""

    last: Watched

    def __init__(self, *arguments: Any, **others: Any) -> None:
        super().__init__(*arguments, **others)
        Watched.last = self


class Follower(DrivingNetwork):
    """Accelerates as the recorded driver does, and by so much more [m/s²]."""

    more = 0.0

    def forward(self, features: Tensor) -> Tensor:
        wanted = torch.from_numpy(Watched.last.expert_acceleration) + self.more
        return torch.atanh((wanted / SCALE).clamp(-0.999999, 0.999999))


class Brake(DrivingNetwork):
    """Brakes as hard as it can, and stays."""

    def forward(self, features: Tensor) -> Tensor:
        return torch.full(features.shape[:-1], -20.0)


def distances(scenes: Scenes) -> tuple[np.ndarray, np.ndarray]:
    """What each vehicle recorded for more than 10 s drives in them, and how fast it is at first; float64."""
    worlds = ReplayWorlds(scenes, split="development")
    tracks = [track for scene in worlds.tracks.scenes for track in scene.tracks]
    driven, fast = [], []
    for track in (tracks[index] for index in worlds.tracks.actors):
        first = int(np.argmax(track.observed))
        if steps_to_act(track) > HORIZON:
            driven.append(float(track.position[first + HORIZON]) - float(track.position[first]))
            fast.append(float(track.speed[first]))
    return np.array(driven), np.array(fast)


def test_who_drives_as_recorded_makes_no_error(scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imitation.tracks, "ReplayWorlds", Watched)
    error = replay_error(Follower(), scenes, "development")
    assert error.rmse < 0.05
    assert error.mad < 0.02
    assert error.count == len(distances(scenes)[0]) > 5
    assert error.collisions == 0.0


def test_who_accelerates_more_is_ahead_by_the_integral(scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of 0.1 m/s² times the square of 10 s is 5 m, less what a vehicle at a stand would have to roll back."""
    monkeypatch.setattr(imitation.tracks, "ReplayWorlds", Watched)
    follower = Follower()
    follower.more = 0.1
    assert replay_error(follower, scenes, "development").mad == pytest.approx(5.0, abs=0.2)


def test_who_brakes_at_once_errs_by_what_was_driven(scenes: Scenes) -> None:
    driven, speed = distances(scenes)
    rolled = np.zeros_like(speed)
    for _ in range(HORIZON):
        after = np.maximum(0.0, speed - 0.2 * SCALE)
        rolled += 0.2 * (speed + after) / 2
        speed = after
    error = replay_error(Brake(), scenes, "development")
    assert error.count == len(driven)
    assert error.rmse == pytest.approx(np.sqrt(np.mean((driven - rolled) ** 2)), rel=1e-3)
    assert error.mad == pytest.approx(np.median(np.abs(driven - rolled)), rel=1e-3)
    assert error.line_runs == 0.0


def test_who_never_brakes_collides(scenes: Scenes) -> None:
    class Rush(Brake):
        def forward(self, features: Tensor) -> Tensor:
            return torch.full(features.shape[:-1], 0.2)

    error = replay_error(Rush(), scenes, "development")
    assert error.collisions > 0.05


def test_who_is_held_and_drives_on_has_run_the_line(scenes: Scenes) -> None:
    """At 3 m/s it can stop until 1.1 m before its line, some two steps before it is there; by then it cannot."""

    class Steady(DrivingNetwork):
        speed, gain = 3.0, 2.0

        def forward(self, features: Tensor) -> Tensor:
            return self.gain * (self.speed - features[..., Driving.SPEED])

    error = replay_error(Steady(), scenes, "development")
    assert 0.0 < error.line_runs < 0.5


# The discriminator


def rows(count: int, shift: float = 0.0, seed: int = 0) -> Tensor:
    """Features about 3, in very different units."""
    generator = torch.Generator().manual_seed(seed)
    return 3.0 + torch.logspace(-2, 2, 12) * (shift + torch.randn(count, 12, generator=generator))


def learned(
    expert: Tensor, policy: Tensor, updates: int = 60, **settings: Any
) -> tuple[Discriminator, list[TensorDict]]:
    """A discriminator after so many updates, and what its loss gave at each."""
    torch.manual_seed(1)
    discriminator = Discriminator.of(expert)
    loss = DiscriminatorLoss(
        discriminator, DiscriminatorSettings(**{"gradient_penalty": 0.0, **settings}), torch.Generator().manual_seed(0)
    )
    optimizer = torch.optim.Adam(discriminator.parameters(), lr=1e-3)
    seen = []
    for _ in range(updates):
        terms = loss(TensorDict({"expert": expert, "policy": policy}))
        optimizer.zero_grad()
        terms["loss_discriminator"].backward()
        optimizer.step()
        seen.append(terms.detach())
    return discriminator, seen


def test_discriminator_separates_two_different_sets() -> None:
    expert, policy = rows(1000), rows(1000, shift=1.5, seed=1)
    discriminator, seen = learned(expert, policy)
    assert seen[-1]["accuracy"] > 0.95
    unseen = rows(1000, seed=2), rows(1000, shift=1.5, seed=3)
    with torch.no_grad():
        assert (discriminator(unseen[0]) > 0).float().mean() > 0.95
        assert (discriminator(unseen[1]) < 0).float().mean() > 0.95
    reward = [discriminator.reward(one) for one in unseen]
    assert reward[0].mean() > 0.5
    assert reward[1].mean() < -0.5


def test_reward_is_minus_the_log_of_being_the_policys_and_0_where_there_is_no_telling() -> None:
    discriminator, _ = learned(rows(100), rows(100, shift=1.0, seed=1), updates=20)
    with torch.no_grad():
        likely = torch.sigmoid(discriminator(rows(50, seed=5)).double())
    torch.testing.assert_close(discriminator.reward(rows(50, seed=5)).double(), -torch.log1p(-likely) - np.log(2.0))
    with torch.no_grad():
        for parameter in discriminator.layers[-1].parameters():
            parameter.zero_()
    torch.testing.assert_close(discriminator.reward(rows(50)), torch.zeros(50))


def test_discriminator_sits_at_chance_on_two_halves_of_one_set(expert: ExpertSteps) -> None:
    both = torch.from_numpy(expert.observation)
    shuffled = both[torch.randperm(len(both))][: len(both) // 2 * 2]
    _, seen = learned(shuffled[::2], shuffled[1::2])
    accuracy = torch.stack([terms["accuracy"] for terms in seen])
    assert ((accuracy > 0.45) & (accuracy < 0.55)).all()


def test_features_are_scaled_to_the_experts_once_and_for_all() -> None:
    expert, policy = rows(1000), rows(1000, shift=3.0, seed=1)
    expert[:, 4] = 7.0  # a feature that never changes
    discriminator, _ = learned(expert, policy, updates=5)
    torch.testing.assert_close(discriminator.mean, expert.mean(dim=0))
    clean = discriminator.normalised(expert).double()
    torch.testing.assert_close(clean.mean(dim=0), torch.zeros(12).double(), atol=1e-3, rtol=0)
    varied = torch.arange(12) != 4
    torch.testing.assert_close(clean.std(dim=0)[varied], torch.ones(11).double(), atol=1e-3, rtol=0)
    assert torch.isfinite(discriminator(policy)).all()
    assert not {"mean", "deviation"} & dict(discriminator.named_parameters()).keys()


class Spy(nn.Module):
    """Layers that keep what they are given, and answer with one number."""

    def __init__(self, logit: float) -> None:
        super().__init__()
        self.logit = nn.Parameter(torch.tensor(logit))
        self.seen = torch.zeros(0)

    def forward(self, features: Tensor) -> Tensor:
        self.seen = features.detach()
        return self.logit.expand(len(features), 1)


def spied(logit: float, **settings: Any) -> tuple[Spy, TensorDict]:
    expert, policy = rows(3000), rows(3000, shift=1.0, seed=1)
    discriminator, spy = Discriminator.of(expert), Spy(logit)
    discriminator.layers = spy  # type: ignore[assignment]
    loss = DiscriminatorLoss(
        discriminator, DiscriminatorSettings(**{"gradient_penalty": 0.0, **settings}), torch.Generator().manual_seed(0)
    )
    terms = loss(TensorDict({"expert": expert, "policy": policy}))
    clean = discriminator.normalised(torch.cat([expert, policy]))
    spy.seen = spy.seen - clean
    return spy, terms.detach()


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5])
def test_noise_of_the_stated_deviation_is_on_both_sides(noise: float) -> None:
    spy, _ = spied(0.0, noise=noise)
    for side in (spy.seen[:3000], spy.seen[3000:]):
        assert float(side.std()) == pytest.approx(noise, rel=0.02)
        assert abs(float(side.mean())) <= 4 * noise * side.numel() ** -0.5


@pytest.mark.parametrize("smoothing", [0.0, 0.1, 0.3])
def test_labels_are_softened_as_stated(smoothing: float) -> None:
    _, terms = spied(1.5, smoothing=smoothing)
    log_yes, log_no = np.log(1 / (1 + np.exp(-1.5))), np.log(1 / (1 + np.exp(1.5)))
    expert = (1 - smoothing) * log_yes + smoothing * log_no
    policy = smoothing * log_yes + (1 - smoothing) * log_no
    assert float(terms["loss_discriminator"]) == pytest.approx(-(expert + policy) / 2, rel=1e-5)
    assert float(terms["accuracy"]) == 0.5


def test_gradient_penalty_draws_the_gradient_to_0() -> None:
    expert, policy = rows(300), rows(300, shift=3.0, seed=1)
    norms = {}
    for weight in (1e-9, 10.0):  # at 0 the norm is not even watched
        _, seen = learned(expert, policy, updates=150, gradient_penalty=weight, smoothing=0.0)
        norms[weight] = [float(terms["gradient_norm"]) for terms in seen]
    assert norms[10.0][-1] < 0.15
    assert norms[1e-9][-1] > 1.3


# The training


def trained(settings: GailSettings, run: Path, **others: Any) -> tuple[str, bytes]:
    """What an unbroken run by `main` leaves."""
    assert main(replace(settings, run=run, **others)) == 0
    return outcome(run)


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


def test_discriminator_rests_above_the_accuracy_asked_for(tiny: GailSettings, scenes: Scenes, tmp_path: Path) -> None:
    after = {}
    for most in (-1.0, 1.0):
        for epochs in (1, 3):
            run = tmp_path / f"{most} {epochs}"
            settings = replace(tiny, epochs=epochs, discriminator=DiscriminatorSettings(updates=2, most_accuracy=most))
            train_driver(scenes, None, settings, RunFolder.begin(run, {}, "", False), progress=False)
            after[most, epochs] = state_hash(torch.load(run / CHECKPOINT)["discriminator"])
    assert after[-1.0, 1] == after[-1.0, 3]
    assert after[1.0, 1] != after[1.0, 3]


def test_run_killed_three_times_ends_like_an_unbroken_one(tiny: GailSettings, tmp_path: Path) -> None:
    wanted = trained(tiny, tmp_path / "unbroken", epochs=60)
    broken = replace(tiny, run=tmp_path / "broken", epochs=60)
    killed(main, broken)
    assert main(replace(broken, resume=True)) == 0
    assert outcome(broken.run) == wanted
    policies = [(tmp_path / name / "gail.policy").read_bytes() for name in ("broken", "unbroken")]
    assert policies[0] == policies[1]


def test_run_interrupted_by_ctrl_c_ends_like_an_unbroken_one(
    tiny: GailSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trained(tiny, tmp_path / "unbroken")
    through = RunFolder.append

    def press(self: RunFolder, row: Mapping[str, Any]) -> None:
        through(self, row)
        if row["epoch"] == 4:
            signal.raise_signal(signal.SIGINT)

    broken = replace(tiny, run=tmp_path / "broken")
    with monkeypatch.context() as patch:
        patch.setattr(RunFolder, "append", press)
        assert main(broken) == 130
    assert f"--resume goes on from {broken.run}" in capsys.readouterr().err
    assert torch.load(broken.run / CHECKPOINT)["epoch"] == 5, "the epoch under way is finished first"
    assert main(replace(broken, resume=True)) == 0
    assert outcome(broken.run) == wanted


def test_threads_change_no_byte_and_the_seed_does(tiny: GailSettings, tmp_path: Path) -> None:
    one, two = (trained(tiny, tmp_path / str(count), threads=count) for count in (1, 2))
    assert one == two
    assert trained(tiny, tmp_path / "other", seed=1)[0] != one[0]


def test_main_writes_a_policy_that_drives_predictor_and_worlds(
    tiny: GailSettings, scenes: Scenes, ppo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = replace(tiny, run=tmp_path / "run", ppo=ppo, tensorboard=True)
    assert main(settings) == 0
    path = tmp_path / "run" / "gail.policy"
    assert f"written: {path}" in capsys.readouterr().out
    policy = Predictor.load(path).policy
    shipped = Predictor.load("gap").policy
    assert policy.driver == "network"
    assert policy.gap_network is not None
    assert shipped.gap_network is not None
    np.testing.assert_array_equal(policy.gap_network.layers[0][0], shipped.gap_network.layers[0][0])
    driver = Driver(DrivingNetwork(), DrivingNetwork(), 1.0)
    driver.load_state_dict(torch.load(tmp_path / "run" / CHECKPOINT)["driver"])
    assert policy.driving_network is not None
    np.testing.assert_array_equal(policy.driving_network.layers[1][0], driver.policy.second.weight.detach())
    ClosedLoopWorlds(gap=path).reset(0)
    assert policy.about["made_by"] == "python -m imitation.gail"
    assert policy.about["settings"] == decisive(settings)
    assert policy.about["map"] == "bendplatz"
    assert policy.about["sha256"] == {
        "scenes": file_hash(settings.scenes),
        "ppo": state_hash(start_of(ppo).state_dict()),
    }
    figures = replay_error(driver.policy, scenes, "development")
    assert ReplayError(**policy.about["development"]).rmse == pytest.approx(figures.rmse, abs=1e-5)
    lines = [json.loads(line) for line in (settings.run / METRICS).read_text().splitlines()]
    assert [line["epoch"] for line in lines] == list(range(1, 9))
    assert ["development" in line for line in lines] == [False, False, True, False, False, True, False, True]
    assert any(name.startswith("events.out.tfevents") for name in files(settings.run))


def test_gaps_in_the_replays_can_be_decided_by_a_policy(tiny: GailSettings, tmp_path: Path) -> None:
    others = [trained(tiny, tmp_path / gap, gap=gap, epochs=2)[0] for gap in ("recording", "gap")]
    assert others[0] != others[1]
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


def refused(settings: GailSettings, capsys: pytest.CaptureFixture[str]) -> str:
    """The error of a run that must not begin."""
    assert main(settings) == 1
    assert not settings.run.exists(), "a run that never began has a folder"
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    return error


@pytest.mark.parametrize(("there", "missing"), [("development", "train"), ("train", "development")])
def test_scenes_without_a_split_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], there: str, missing: str
) -> None:
    small_scenes(there).save(tmp_path / "a.npz")
    error = refused(replace(TINY, scenes=tmp_path / "a.npz", run=tmp_path / "run"), capsys)
    assert str(tmp_path / "a.npz") in error
    assert f'no scene of split "{missing}"' in error


def test_scenes_in_which_nobody_can_act_are_refused(
    scenes: Scenes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bicycles = tuple(
        replace(scene, tracks=tuple(replace(track, road_user="bicycle") for track in scene.tracks)) for scene in scenes
    )
    replace(scenes, scenes=bicycles).save(tmp_path / "a.npz")
    error = refused(replace(TINY, scenes=tmp_path / "a.npz", run=tmp_path / "run"), capsys)
    assert f'{tmp_path / "a.npz"}, split "train"' in error
    assert "bicycles" in error


def test_scenes_in_which_nobody_can_be_watched_for_ten_seconds_are_refused(
    scenes: Scenes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def late(track: Track) -> Track:
        return replace(track, observed=np.arange(len(track.position)) >= len(track.position) - HORIZON - 1)

    brief = tuple(
        replace(scene, tracks=tuple(late(track) for track in scene.tracks)) if scene.split == "development" else scene
        for scene in scenes
    )
    replace(scenes, scenes=brief).save(tmp_path / "a.npz")
    error = refused(replace(TINY, scenes=tmp_path / "a.npz", run=tmp_path / "run"), capsys)
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
    header, arrays = read_scenes_file(tiny.scenes)
    write_scenes_file(tmp_path / "a.npz", spoil(header), arrays)
    error = refused(replace(tiny, scenes=tmp_path / "a.npz", run=tmp_path / "run"), capsys)
    assert str(tmp_path / "a.npz") in error
    assert message in error


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scenes": Path("missing.npz")}, "missing.npz"),
        ({"ppo": Path("missing")}, "missing holds no checkpoint to begin with"),
        ({"gap": "idm"}, 'the policy "idm" has no gap network'),
        ({"decider": "idm"}, 'the policy "idm" has no gap network'),
        ({"decider": "missing.policy"}, "missing.policy"),
    ],
)
def test_bad_settings_are_named_with_status_1(
    tiny: GailSettings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    settings: dict[str, Any],
    message: str,
) -> None:
    assert message in refused(replace(tiny, run=tmp_path / "run", **settings), capsys)


def test_start_that_is_none_of_ppo_is_refused(
    tiny: GailSettings, ppo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = tmp_path / "start"
    settings = replace(tiny, run=tmp_path / "run", ppo=start)
    start.mkdir()
    (start / CHECKPOINT).write_bytes((ppo / CHECKPOINT).read_bytes())
    left = cut_short(start)
    assert f"{start / CHECKPOINT} is damaged" in refused(settings, capsys)
    assert (start / CHECKPOINT).read_bytes() == left
    other_kind: list[Any] = [{"network": {}, "epoch": 1}, {"driver": nn.Linear(2, 2).state_dict()}, [1], {"driver": 3}]
    for state in other_kind:
        torch.save(state, start / CHECKPOINT)
        assert f"{start / CHECKPOINT} is of no training by python -m agents.ppo" in refused(settings, capsys)


def test_a_run_goes_on_with_its_own_settings_and_data_only(
    tiny: GailSettings, ppo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    wanted = trained(tiny, run)
    small_scenes("train", "development", "validation").save(tmp_path / "more.npz")
    capsys.readouterr()
    for others, message in (
        ({}, "holds a run already"),
        ({"resume": True, "seed": 1}, 'had "seed" = 0, not 1'),
        ({"resume": True, "discriminator": DiscriminatorSettings()}, 'had "discriminator"'),
        ({"resume": True, "ppo": ppo}, 'had "data"'),
        ({"resume": True, "scenes": tmp_path / "more.npz"}, 'had "data"'),
    ):
        assert main(replace(tiny, run=run, **others)) == 1
        assert message in capsys.readouterr().err
    assert outcome(run) == wanted


def test_checkpoint_cut_short_is_named_and_left_as_it_is(
    tiny: GailSettings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    trained(tiny, run)
    metrics, left = (run / METRICS).read_bytes(), cut_short(run)
    assert main(replace(tiny, run=run, resume=True)) == 1
    assert f"error: {run / CHECKPOINT} is damaged" in capsys.readouterr().err
    assert (run / CHECKPOINT).read_bytes() == left
    assert (run / METRICS).read_bytes() == metrics


def test_full_disk_leaves_the_previous_checkpoint(
    tiny: GailSettings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trained(tiny, tmp_path / "unbroken")
    settings = replace(tiny, run=tmp_path / "run")
    through = RunFolder.save

    def fills(self: RunFolder, state: Mapping[str, Any]) -> None:
        if state["epoch"] < 6:
            return through(self, state)
        with full_disk(8192):
            return through(self, state)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "save", fills)
        assert main(settings) == 1
    assert f"error: {settings.run / CHECKPOINT} cannot be written" in capsys.readouterr().err
    assert files(settings.run) == {"config.json", METRICS, CHECKPOINT}, "something half-written is left"
    assert torch.load(settings.run / CHECKPOINT)["epoch"] == 3
    assert main(replace(settings, resume=True)) == 0
    assert outcome(settings.run) == wanted
