"""What both environments draw: pictures and videos."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo
from pettingzoo.utils.wrappers import RecordVideoParallel

from intersection_env import Replay, ReplayVector, parallel_env
from tests.support.doors import STILL, episode
from tests.support.episodes import gentle


def test_videos_of_the_closed_loop_are_recorded(tmp_path: Path) -> None:
    recorder = RecordVideoParallel(parallel_env(render_mode="rgb_array"), str(tmp_path / "videos"))
    recorder.reset(seed=1)
    generator = np.random.default_rng(0)
    for _ in range(5):
        recorder.step(gentle(recorder.unwrapped, generator))
    recorder.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_picture_shows_the_world() -> None:
    environment = parallel_env(render_mode="rgb_array")
    environment.reset(seed=1)
    first = environment.render()
    episode(environment, np.random.default_rng(0), 3)
    second = environment.render()
    assert first is not None
    assert first.shape == (600, 600, 3)
    assert (first != second).any()
    environment.close()
    environment.close()


def test_videos_of_the_replay_are_recorded(tmp_path: Path) -> None:
    environment: Any = RecordVideo(
        gymnasium.make("intersection_env/Replay-v0", render_mode="rgb_array"), str(tmp_path / "videos")
    )
    environment.reset(seed=1)
    episode(environment, np.random.default_rng(0))
    environment.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000


def test_pictures_show_the_world_and_each_world_of_a_vector() -> None:
    environment = Replay(render_mode="rgb_array")
    environment.reset(seed=1)
    first = environment.render()
    environment.step(STILL)
    second = environment.render()
    assert first is not None
    assert first.shape == (600, 600, 3)
    assert (first != second).any()
    envs = ReplayVector(3, render_mode="rgb_array")
    envs.reset(seed=1)
    pictures = envs.render()
    assert pictures is not None
    assert len(pictures) == 3
    assert (pictures[0] == first).all()
    assert (pictures[1] != first).any()
    doors: tuple[Any, ...] = (environment, envs)
    for one in doors:
        one.close()
        one.close()


@pytest.mark.parametrize("make", [parallel_env, Replay, lambda: ReplayVector(2)])
def test_render_without_a_mode_warns(make: Any) -> None:
    environment = make()
    environment.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode"):
        assert environment.render() is None
