"""Training by the gradient of rollouts: it learns, the gap network only when it should, and rates rise and fall."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.training.folder import METRICS, RunFolder
from imitation.replay_error import constant_velocity_network, replay_error
from imitation.rollout_gradient import PROFILES, Data, RolloutSettings, _rate, main, train_driver
from intersection_env import Intersection, Predictor, Scenes
from intersection_env.maps.limits import with_limits
from intersection_env.policies.file import PolicyFile
from tests.support.scenes import small_scenes
from tests.support.trainings import TINY_ROLLOUT

QUICK = replace(TINY_ROLLOUT, epochs=60, alone_share=1.0, every=1.0, drives=128, checkpoint_every=60)


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train", "development", each=2)


def test_a_few_seconds_of_training_beat_constant_velocity(scenes: Scenes, tmp_path: Path) -> None:
    folder = RunFolder.begin(tmp_path, {}, "", resume=False)
    driver, _ = train_driver([scenes], QUICK, folder, progress=False)
    losses = [json.loads(line)["loss_alone"] for line in (tmp_path / METRICS).read_text().splitlines()]
    assert losses[-1] < 0.3 * losses[0]
    learned, untrained, steady = (
        replay_error(one, scenes, "development", within_limits=True, steps=20).rmse
        for one in (driver, DrivingNetwork(), constant_velocity_network())
    )
    assert learned is not None
    assert untrained is not None
    assert steady is not None
    assert learned < min(untrained, steady)


@pytest.mark.parametrize(
    ("change", "learns"),
    [({}, True), ({"learns_gaps": False}, False), ({"alone_share": 1.0}, False), ({"joint_weight": 0.0}, False)],
    ids=["jointly", "told not to", "alone", "without weight"],
)
def test_the_gap_network_learns_in_joint_rollouts_only(
    change: dict[str, object], learns: bool, scenes: Scenes, tmp_path: Path
) -> None:
    scenes.save(tmp_path / "scenes.npz")
    settings = replace(TINY_ROLLOUT, scenes=(tmp_path / "scenes.npz",), run=tmp_path / "run", **change)  # type: ignore[arg-type]
    assert main(settings) == 0
    written = PolicyFile.read(settings.run / "rollout_gradient.policy")
    begun, learned = Predictor.load("gap").policy.gap_network, written.gap_network
    assert begun is not None
    assert learned is not None
    pairs = zip(begun.layers, learned.layers, strict=True)
    same = all(np.array_equal(one[k], other[k]) for one, other in pairs for k in (0, 1))
    assert same != learns


def test_each_place_is_learned_from_with_each_of_the_limits() -> None:
    places = [Scenes.load("t_junction")]
    once, twice = (Data.of(places, replace(TINY_ROLLOUT, limits=limits)) for limits in ((1.0,), (1.0, 1.5)))
    assert once.moments is not None
    assert twice.moments is not None
    count = len(once.moments.traffics)
    assert len(twice.moments.traffics) == 2 * count
    recorded = len(once.drives.route) - TINY_ROLLOUT.free_drives
    assert len(twice.drives.route) == 2 * recorded + TINY_ROLLOUT.free_drives
    routes = len(places[0].intersection.routes)
    assert twice.drives.route[recorded] == twice.drives.route[0] + routes
    v_max = [twice.tables.road(twice.drives.route[[row]], twice.drives.position[[row], 0])[0] for row in (0, recorded)]
    assert v_max[1] == pytest.approx(1.5 * v_max[0].item())
    same = (getattr(twice.drives, name) for name in ("position", "speed", "delta"))
    assert all(torch.equal(one[:recorded], one[recorded : 2 * recorded]) for one in same)


def test_maps_without_recordings_are_driven_freely_with_each_of_the_limits() -> None:
    ring, places = Intersection.load("roundabout"), [Scenes.load("t_junction")]
    none, some = (Data.of(places, replace(TINY_ROLLOUT, free_maps=maps)) for maps in ((), ("roundabout",)))
    assert ring.checksum not in none.tables.begin
    free = some.drives.route[-TINY_ROLLOUT.free_drives :]
    begins = [some.tables.begin[with_limits(ring, times).checksum] for times in TINY_ROLLOUT.limits]
    for begin in begins:
        assert ((free >= begin) & (free < begin + len(ring.routes))).any()
    assert not torch.isin(some.drives.route[: -TINY_ROLLOUT.free_drives], free[free >= min(begins)]).any()
    with pytest.raises(ValueError, match='"all_way_stop" has an all-way stop, which the model in torch does not know'):
        Data.of(places, replace(TINY_ROLLOUT, free_maps=("all_way_stop",)))


def test_the_rate_rises_and_falls() -> None:
    settings = RolloutSettings(epochs=10, alone_share=0.4)
    assert settings.alone_epochs == 4
    rates = [_rate(settings, epochs) for epochs in (0.0, 2.0, 10.0)]
    assert rates == pytest.approx([share * settings.learning_rate for share in (0.1, 1.0, 0.02)])


def test_the_profile_alone_has_no_joint_rollouts() -> None:
    _, alone = PROFILES["alone"]
    assert alone.alone_epochs == alone.epochs


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"decider": "sumo"}, "holds no gap network"),
        ({"teacher": "gail"}, "taught by an IDM"),
        ({"limits": ()}, "at least one number above 0"),
        ({"limits": (1.0, 0.0)}, "at least one number above 0"),
    ],
)
def test_a_decider_without_a_gap_network_a_teacher_without_idm_and_limits_that_are_none_are_refused(
    change: dict[str, Any], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(replace(TINY_ROLLOUT, run=tmp_path / "run", **change)) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
