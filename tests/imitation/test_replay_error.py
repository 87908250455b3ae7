"""The error in the replays, of drivers of whom it is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

import imitation.tracks
from agents.networks.driving import DrivingNetwork
from imitation.replay_error import replay_error
from intersection_env import ReplayWorlds, Scenes
from intersection_env.constants import ACCELERATION, DT, STEPS
from intersection_env.features import Driving
from intersection_env.worlds.recorded_tracks import steps_to_act
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("development")


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
        return torch.atanh((wanted / ACCELERATION).clamp(-0.999999, 0.999999))


class Brake(DrivingNetwork):
    """Brakes as hard as it can, and stays."""

    def forward(self, features: Tensor) -> Tensor:
        return torch.full(features.shape[:-1], -20.0)


def distances(scenes: Scenes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What each vehicle recorded for more than 10 s drives in them, and how fast it is at first; float64."""
    worlds = ReplayWorlds(scenes, split="development")
    tracks = [track for scene in worlds.tracks.scenes for track in scene.tracks]
    driven, fast = [], []
    for track in (tracks[index] for index in worlds.tracks.actors):
        first = int(np.argmax(track.observed))
        if steps_to_act(track) > STEPS:
            driven.append(float(track.position[first + STEPS]) - float(track.position[first]))
            fast.append(float(track.speed[first]))
    return np.array(driven), np.array(fast)


def test_who_drives_as_recorded_makes_no_error(scenes: Scenes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imitation.tracks, "ReplayWorlds", Watched)
    error = replay_error(Follower(), scenes, "development")
    assert error.rmse is not None
    assert error.rmse < 0.05
    assert error.mad is not None
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
    for _ in range(STEPS):
        after = np.maximum(0.0, speed - DT * ACCELERATION)
        rolled += DT * (speed + after) / 2
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
