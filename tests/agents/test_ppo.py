"""The driver's training by PPO: its parts against plain sums, its result, and that nothing of a run is lost."""

from __future__ import annotations

import dataclasses
import json
import math
import signal
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import tyro
from tensordict import TensorDict
from torch import Tensor

from agents.networks.driving import Driver, DrivingNetwork
from agents.networks.export import driving_policy
from agents.ppo import PROFILES, PpoSettings, main, train_driver
from agents.rollouts.collector import Rollouts
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.rollouts.validation_run import validation_run
from agents.training.folder import CHECKPOINT, METRICS, RunFolder, decisive
from intersection_env import ClosedLoopWorlds, Predictor, _core
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import gap_decider
from tests.agents.test_torchrl import GAMMA, LAMBDA, recursion
from tests.support.training import cut_short, files, full_disk, killed, outcome, with_other_feature
from tests.support.twins import random_case

TINY = PpoSettings(
    gaps=("critical_gap",),
    worlds=4,
    vehicles=6,
    steps=16,
    epochs=8,
    update=UpdateSettings(passes=1, minibatches=2),
    threads=1,
    checkpoint_every=3,
)
SHORT = PpoSettings(
    worlds=32,
    steps=32,
    epochs=30,
    learning_rate=4e-3,
    last_learning_rate=1e-3,
    last_sigma=0.2,
    update=UpdateSettings(passes=4, minibatches=4),
)
COLLISION = 5000.0


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


def driver() -> Driver:
    return Driver(DrivingNetwork(), DrivingNetwork(), 0.3)


def worlds(**arguments: Any) -> ClosedLoopWorlds:
    """Worlds that end soon, just begun."""
    made = ClosedLoopWorlds(**({"worlds": 8, "max_cycles": 60} | arguments))
    made.reset(3, desynchronise=True)
    return made


def weights(network: torch.nn.Module) -> bytes:
    return b"".join(parameter.detach().numpy().tobytes() for parameter in network.parameters())


# The policy


def test_exported_driving_network_equals_torch_in_the_core() -> None:
    network = DrivingNetwork()
    low = [-40.0, 0.0, 0.0, *[-np.pi] * 6, 0.0, 0.0, 0.0]
    high = [90.0, 20.0, 20.0, *[np.pi] * 6, 100.0, 28.0, 1.0]
    features = np.random.default_rng(0).uniform(low, high, (1000, 12)).astype(np.float32)
    with torch.no_grad():
        truth = network(torch.from_numpy(features)).numpy()
    text = driving_policy(gap_decider("gap"), network, {}).text()
    np.testing.assert_allclose(_core.Policy(text, "a test").evaluate_driving(features), truth, atol=1e-5)


def test_predictor_drives_by_the_exported_network(tmp_path: Path) -> None:
    """Where its limits leave it free: nobody close ahead, and no line at which to wait; else it brakes the harder."""
    network = DrivingNetwork()
    driving_policy(gap_decider("gap"), network, {"made_by": "a test"}).save(tmp_path / "a.policy")
    predictor = Predictor.load(tmp_path / "a.policy")
    compared = 0
    for seed in range(40):
        traffic, _ = random_case("bendplatz", seed)
        seen = predictor.observe(traffic).driving
        with torch.no_grad():
            wanted = 6.0 * torch.tanh(network(torch.from_numpy(seen))).numpy()
        prediction = predictor.predict(traffic)
        drives = prediction.present[0, 0] & (prediction.speed[0, 1] > 0.0)
        done = prediction.acceleration[0, 0]
        assert (done[drives] <= wanted[drives] + 1e-4).all()
        to_line, to_lead, enters = (
            seen[:, k] for k in (Driving.DISTANCE_TO_STOP_LINE, Driving.LEAD_DISTANCE, Driving.ENTERS)
        )
        free = drives & (to_lead > 60.0) & ((enters == 1.0) | (to_line > 60.0))
        np.testing.assert_allclose(done[free], wanted[free], atol=1e-4)
        compared += int(free.sum())
    assert compared > 50


# The update


def test_advantages_are_the_recursion_that_reinsertions_cut_normalised() -> None:
    data = Rollouts(worlds(max_cycles=2000), 100).collect(driver())
    done = data["next", "done"].squeeze(-1)
    alone = done & ~done.all(dim=2, keepdim=True)
    assert alone[:, :-1].sum() > 5, "no reinsertion"
    wanted = recursion(data)
    target = (wanted + data["state_value"].double()).reshape(-1, 1)
    wanted = ((wanted - wanted.mean()) / wanted.std()).reshape(-1, 1)
    samples = PolicyUpdate(driver(), UpdateSettings(gamma=GAMMA, trace=LAMBDA)).advantages(data)
    torch.testing.assert_close(samples["advantage"].double(), wanted, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(samples["value_target"].double(), target, atol=1e-2, rtol=1e-4)
    assert (samples["observation"] == data["observation"].reshape(-1, 12)).all()


def update_of(of: Driver, value_only: bool = False, rate: float = 1e-3, **settings: Any) -> dict[str, float]:
    """What an update says of a rollout's samples."""
    data = Rollouts(worlds(), 32).collect(of)
    data["next", "reward"].mul_(0.01)
    update = PolicyUpdate(of, UpdateSettings(**settings))
    return update(update.advantages(data), rate, torch.Generator().manual_seed(0), value_only)


def test_an_update_moves_policy_and_value() -> None:
    of = driver()
    before = weights(of.policy), weights(of.value)
    update_of(of)
    assert weights(of.policy) != before[0]
    assert weights(of.value) != before[1]


def test_an_update_of_the_value_alone_leaves_every_byte_of_the_policy() -> None:
    of = driver()
    before = weights(of.policy), weights(of.value)
    update_of(of, value_only=True)
    assert weights(of.policy) == before[0]
    assert weights(of.value) != before[1]


def test_passes_end_at_the_largest_kl() -> None:
    within, beyond = 0.003, 0.05
    seen = {}
    for largest in (-1.0, within, beyond, math.inf):
        torch.manual_seed(0)
        seen[largest] = update_of(driver(), largest_kl=largest, passes=8, minibatches=3)
    assert seen[-1.0]["updates"] == 3
    assert 3 < seen[within]["updates"] < 24
    assert seen[within]["kl"] > within
    assert seen[beyond] == seen[math.inf]
    assert seen[beyond]["updates"] == 24


def test_an_update_favours_what_went_better_than_expected() -> None:
    """Up is good, down is bad: the mean action goes up."""
    of = driver()
    data = Rollouts(worlds(), 32).collect(of)
    with torch.no_grad():
        before = of.policy(data["observation"])
    up = torch.sign(data["action"] - before.unsqueeze(-1))
    samples = data.select("observation", "action", "action_log_prob").reshape(-1)
    samples["advantage"] = up.reshape(-1, 1)
    samples["value_target"] = torch.zeros_like(samples["advantage"])
    PolicyUpdate(of, UpdateSettings())(samples, 1e-3, torch.Generator().manual_seed(0))
    with torch.no_grad():
        assert (of.policy(data["observation"]) - before).mean() > 0.02


# The training


def test_a_short_training_more_than_halves_what_driving_costs() -> None:
    """Mean reward is negative for random networks, from the collisions; over seeds 0-4 it fell to 0.06-0.30 of it."""
    before, after = (
        validation_run(policy, gap="gap", seed=99, worlds=4, steps=250)
        for policy in (DrivingNetwork(), train_driver(SHORT, progress=False).policy)
    )
    assert before.reward < -10.0
    assert after.reward > before.reward / 2
    assert after.collisions < before.collisions
    assert after.speed > 5.0


def test_learning_rate_and_sigma_fall_as_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[float, float]] = []
    through = PolicyUpdate.__call__

    def spy(self: PolicyUpdate, samples: TensorDict, learning_rate: float, *others: Any) -> dict[str, float]:
        spread = float((samples["action"] - self.mean(samples)).std())  # type: ignore[attr-defined]
        seen.append((learning_rate, spread))
        return through(self, samples, learning_rate, *others)

    def init(self: PolicyUpdate, of: Driver, settings: UpdateSettings) -> None:
        begin(self, of, settings)
        self.mean = lambda samples: of(samples["observation"])[0].detach()  # type: ignore[attr-defined]

    begin = PolicyUpdate.__init__
    monkeypatch.setattr(PolicyUpdate, "__init__", init)
    monkeypatch.setattr(PolicyUpdate, "__call__", spy)
    settings = replace(TINY, worlds=16, epochs=5, learning_rate=1e-3, last_learning_rate=2e-4, last_sigma=0.01)
    trained = train_driver(settings, progress=False)
    np.testing.assert_allclose([rate for rate, _ in seen], [1e-3, 8e-4, 6e-4, 4e-4, 2e-4])
    falls = 0.3 * (0.01 / 0.3) ** np.array([0.0, 0.0, 0.25, 0.5, 0.75])  # a rollout's is that of the epoch before
    np.testing.assert_allclose([spread for _, spread in seen], falls, rtol=0.1)
    assert float(trained.sigma) == pytest.approx(0.01)


def test_rewards_are_cut_and_scaled_before_they_teach(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Tensor] = []
    through = PolicyUpdate.advantages

    def spy(self: PolicyUpdate, rollout: TensorDict) -> TensorDict:
        seen.append(rollout["next", "reward"].clone())
        return through(self, rollout)

    monkeypatch.setattr(PolicyUpdate, "advantages", spy)
    folds = []
    for least, scale in ((-1e9, 1.0), (-3.0, 0.5)):
        train_driver(replace(TINY, epochs=1, least_reward=least, reward_scale=scale), progress=False)
        folds.append(seen.pop())
    assert folds[0].min() < -3.0
    torch.testing.assert_close(folds[1], 0.5 * folds[0].clamp(min=-3.0))


def trained(run: Path, **others: Any) -> tuple[str, bytes]:
    """What an unbroken run by `main` leaves."""
    assert main(replace(TINY, run=run, **others)) == 0
    return outcome(run)


def test_run_killed_three_times_ends_like_an_unbroken_one(tmp_path: Path) -> None:
    wanted = trained(tmp_path / "unbroken", epochs=60)
    broken = replace(TINY, run=tmp_path / "broken", epochs=60)
    killed(main, broken)
    assert main(replace(broken, resume=True)) == 0
    assert outcome(broken.run) == wanted
    policies = [(tmp_path / name / "ppo.policy").read_bytes() for name in ("broken", "unbroken")]
    assert policies[0] == policies[1]


def test_run_interrupted_by_ctrl_c_ends_like_an_unbroken_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = trained(tmp_path / "unbroken")
    through = RunFolder.append

    def press(self: RunFolder, row: Mapping[str, Any]) -> None:
        through(self, row)
        if row["epoch"] == 4:
            signal.raise_signal(signal.SIGINT)

    broken = replace(TINY, run=tmp_path / "broken")
    with monkeypatch.context() as patch:
        patch.setattr(RunFolder, "append", press)
        assert main(broken) == 130
    assert f"--resume goes on from {broken.run}" in capsys.readouterr().err
    assert torch.load(broken.run / CHECKPOINT)["epoch"] == 5, "the epoch under way is finished first"
    assert main(replace(broken, resume=True)) == 0
    assert outcome(broken.run) == wanted


def test_threads_change_no_byte_and_the_seed_does(tmp_path: Path) -> None:
    one, two = (trained(tmp_path / str(count), threads=count) for count in (1, 2))
    assert one == two
    assert trained(tmp_path / "other", seed=1)[0] != one[0]


def test_main_writes_a_policy_that_drives_predictor_and_worlds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = replace(TINY, run=tmp_path / "run", gaps=("gap",), tensorboard=True)
    assert main(settings) == 0
    path = tmp_path / "run" / "ppo.policy"
    assert f"written: {path}" in capsys.readouterr().out
    policy = Predictor.load(path).policy
    assert policy.driver == "network"
    assert policy.gap_network is not None
    state = torch.load(tmp_path / "run" / CHECKPOINT)["driver"]
    assert policy.driving_network is not None
    np.testing.assert_array_equal(policy.driving_network.layers[1][0], state["policy.second.weight"])
    ClosedLoopWorlds(gap=path).reset(0)
    assert policy.about["made_by"] == "python -m agents.ppo"
    assert policy.about["settings"] == decisive(settings)
    assert policy.about["map"] == "bendplatz"
    assert set(policy.about["validation_run"]) == {"gap", "critical_gap"}
    rows = [json.loads(line) for line in (settings.run / METRICS).read_text().splitlines()]
    assert [row["epoch"] for row in rows] == list(range(1, 9))
    assert ["validation" in row for row in rows] == [False, False, True, False, False, True, False, True]
    assert any(name.startswith("events.out.tfevents") for name in files(settings.run))


def test_command_line_reaches_nested_settings() -> None:
    arguments = ["paper", "--run", "a", "--update.clip", "0.1", "--resume"]
    settings = tyro.extras.overridable_config_cli(PROFILES, args=arguments)
    paper = PROFILES["paper"][1]
    assert settings == replace(paper, run=Path("a"), update=replace(paper.update, clip=0.1), resume=True)


def test_tensorboard_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    assert main(replace(TINY, run=tmp_path / "run", tensorboard=True)) == 1
    assert "pip install 'intersection_env[tensorboard]'" in capsys.readouterr().err
    assert main(replace(TINY, run=tmp_path / "run", epochs=1)) == 0


# The validation run


def test_validation_run_is_what_steps_by_hand_give() -> None:
    policy = DrivingNetwork()
    count, steps = 3, 130  # more than one part of a rollout, and not a whole number of them
    by_hand = ClosedLoopWorlds(worlds=count, vehicles=5)
    by_hand.reset(8, desynchronise=True)
    rewards, speeds, ends = [], [], []
    for _ in range(steps):
        speeds.append(by_hand.observation[..., Driving.SPEED].copy())
        with torch.no_grad():
            by_hand.action[:] = torch.tanh(policy(torch.from_numpy(by_hand.observation))).numpy()
        by_hand.step()
        rewards.append(by_hand.reward.astype(np.float64))
        ends.append(by_hand.terminated.copy())
    run = validation_run(policy, gap="critical_gap", seed=8, worlds=count, steps=steps, vehicles=5)
    reward, ended = np.stack(rewards), np.stack(ends)
    assert ended.sum() > 2
    assert (reward[ended] < -0.9 * COLLISION).all()
    assert run.reward == pytest.approx(reward.mean(), rel=1e-3)
    assert run.reward_between_collisions == pytest.approx(reward[~ended].mean(), rel=1e-3)
    assert run.collisions == pytest.approx(ended.mean() / 0.2)
    assert run.speed == pytest.approx(float(np.mean(speeds)), rel=1e-3)
    assert run.seconds == pytest.approx(count * steps * 0.2)


# Bad input


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gaps": ("idm",)}, 'gap: the policy "idm" has no gap network'),
        ({"gaps": ("missing.policy",)}, "missing.policy"),
        ({"gaps": ("hero",)}, 'no policy "hero"'),
        ({"map": "nowhere"}, "nowhere"),
        ({"worlds": 0}, "worlds"),
        ({"gaps": ()}, "gaps: 0 cannot have equal shares of 4 worlds"),
        ({"gaps": ("gap", "sumo"), "worlds": 3}, "gaps: 2 cannot have equal shares of 3 worlds"),
        ({"vehicles": 65}, "vehicles"),
        ({"steps": 0}, "frames_per_batch is 0"),
        ({"epochs": 0}, "total_frames is 0"),
    ],
)
def test_bad_settings_are_named_with_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], settings: dict[str, Any], message: str
) -> None:
    assert main(replace(TINY, run=tmp_path / "run", **settings)) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error


def test_gap_policies_that_cannot_decide_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    driving_policy(PolicyFile("sumo", "idm"), DrivingNetwork(), {}).save(tmp_path / "blind.policy")
    other = with_other_feature(gap_decider("gap"), tmp_path / "other.policy")
    for path, message in ((tmp_path / "blind.policy", "has no gap network"), (other, "yielder_speed_kmh")):
        assert main(replace(TINY, run=tmp_path / "run", gaps=(str(path),))) == 1
        assert message in capsys.readouterr().err
    assert not (tmp_path / "run").exists(), "a run that never began has a folder"


def test_a_run_goes_on_with_its_own_settings_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = trained(tmp_path)
    capsys.readouterr()
    for others, message in (
        ({}, "holds a run already"),
        ({"resume": True, "seed": 1}, 'had "seed" = 0, not 1'),
        ({"resume": True, "update": UpdateSettings(clip=0.1)}, 'had "update"'),
        ({"resume": True, "gaps": ("gap",)}, 'had "gaps"'),
    ):
        assert main(replace(TINY, run=tmp_path, **others)) == 1
        assert message in capsys.readouterr().err
    assert outcome(tmp_path) == wanted


def test_checkpoint_cut_short_is_named_and_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trained(tmp_path)
    metrics, left = (tmp_path / METRICS).read_bytes(), cut_short(tmp_path)
    assert main(replace(TINY, run=tmp_path, resume=True)) == 1
    assert f"error: {tmp_path / CHECKPOINT} is damaged" in capsys.readouterr().err
    assert (tmp_path / CHECKPOINT).read_bytes() == left
    assert (tmp_path / METRICS).read_bytes() == metrics


def test_full_disk_leaves_the_previous_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = trained(tmp_path / "unbroken")
    settings = replace(TINY, run=tmp_path / "run")
    through = RunFolder.save

    def fills(self: RunFolder, state: Mapping[str, Any]) -> None:
        if state["epoch"] < 6:
            return through(self, state)
        with full_disk(8192):
            return through(self, state)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "save", fills)
        assert main(settings) == 1
    error = capsys.readouterr().err
    assert f"error: {settings.run / CHECKPOINT} cannot be written" in error
    assert files(settings.run) == {"config.json", METRICS, CHECKPOINT}, "something half-written is left"
    assert torch.load(settings.run / CHECKPOINT)["epoch"] == 3
    assert main(replace(settings, resume=True)) == 0
    assert outcome(settings.run) == wanted


def test_full_disk_at_the_policy_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = replace(TINY, run=tmp_path / "run")
    through = PolicyFile.save

    def fills(self: PolicyFile, path: Path) -> None:
        with full_disk(1000):
            through(self, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PolicyFile, "save", fills)
        assert main(settings) == 1
    assert capsys.readouterr().err.startswith("error: ")
    assert files(settings.run) == {"config.json", METRICS, CHECKPOINT}
    assert main(replace(settings, resume=True)) == 0
    assert dataclasses.is_dataclass(Predictor.load(settings.run / "ppo.policy").policy)
