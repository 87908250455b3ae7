"""The driver's training by PPO: driving gets better, what falls falls, and bad settings are named."""

from __future__ import annotations

import json
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
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.rollouts.validation_run import validation_run
from agents.training.folder import CHECKPOINT, METRICS
from intersection_env import Intersection, Predictor
from intersection_env.evaluation.empty_road import empty_road
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import gap_decider
from tests.support.damage import with_checksum
from tests.support.trainings import TINY_PPO as TINY
from tests.support.trainings import refused

SHORT = PpoSettings(
    map=("bendplatz",),
    worlds=32,
    steps=32,
    epochs=30,
    learning_rate=4e-3,
    last_learning_rate=1e-3,
    last_sigma=0.2,
    update=UpdateSettings(passes=4, minibatches=4),
)


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


def test_the_policy_drives_by_the_last_network_and_says_how_it_does(tmp_path: Path) -> None:
    assert main(replace(TINY, run=tmp_path / "run", gaps=("gap",))) == 0
    policy = PolicyFile.read(tmp_path / "run" / "ppo.policy")
    state = torch.load(tmp_path / "run" / CHECKPOINT)["driver"]
    assert policy.driver == "network"
    assert policy.gap_network is not None
    assert policy.driving_network is not None
    np.testing.assert_array_equal(policy.driving_network.layers[1][0], state["policy.second.weight"])
    assert policy.about["maps"] == ["bendplatz"]
    assert set(policy.about["validation_run"]["bendplatz"]) == {"gap", "critical_gap"}
    alone = empty_road(Predictor(policy, "ppo"), maps=[Intersection.load("bendplatz")])
    assert policy.about["empty_road"] == alone.figures()
    rows = [json.loads(line) for line in (tmp_path / "run" / METRICS).read_text().splitlines()]
    assert [row["epoch"] for row in rows if "empty_road" in row] == [3, 6, 8]
    assert rows[-1]["empty_road"] == alone.figures()


def test_command_line_reaches_nested_settings() -> None:
    arguments = ["paper", "--run", "a", "--update.clip", "0.1", "--resume"]
    settings = tyro.extras.overridable_config_cli(PROFILES, args=arguments)
    paper = PROFILES["paper"][1]
    assert settings == replace(paper, run=Path("a"), update=replace(paper.update, clip=0.1), resume=True)


# Bad input


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gaps": ("idm",)}, 'gap: the policy "idm" has no gap network'),
        ({"gaps": ("missing.policy",)}, "missing.policy"),
        ({"gaps": ("hero",)}, 'no policy "hero"'),
        ({"map": ("nowhere",)}, "nowhere"),
        ({"map": ("bendplatz", "bendplatz")}, "--map names a map twice: bendplatz, bendplatz"),
        ({"worlds": 0}, "0 worlds cannot be shared by 1"),
        ({"gaps": ()}, "map: 1, gaps: 0: 4 worlds cannot be shared by 0"),
        ({"gaps": ("gap", "sumo"), "worlds": 1}, "map: 1, gaps: 2: 1 worlds cannot be shared by 2"),
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
    body = gap_decider("gap").text().rpartition("checksum ")[0]
    other_unit = with_checksum(body.replace("yielder_speed_mps", "yielder_speed_kmh"))
    (tmp_path / "other.policy").write_text(other_unit, encoding="utf-8")
    for name, message in (("blind", "has no gap network"), ("other", "yielder_speed_kmh")):
        settings = replace(TINY, run=tmp_path / "run", gaps=(str(tmp_path / f"{name}.policy"),))
        assert message in refused(main, settings, capsys)
