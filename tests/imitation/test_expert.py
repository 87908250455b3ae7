"""The expert's steps are those of the recorded tracks."""

from __future__ import annotations

import numpy as np
import pytest

from imitation.expert import ExpertSteps, expert_steps
from intersection_env import ReplayWorlds, Scenes
from intersection_env.constants import ACCELERATION, DT
from intersection_env.features import Driving
from intersection_env.worlds.recorded_tracks import steps_to_act
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train")


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
        rises = np.diff(track.speed[recorded.start :].astype(np.float64)) / DT
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
            worlds.action[0] = worlds.expert_acceleration[0] / ACCELERATION
            worlds.step()
        assert worlds.truncated[0]


def test_expert_sees_the_gap_decisions_of_the_recording(scenes: Scenes, expert: ExpertSteps) -> None:
    delta = expert.observation[:, Driving.ENTERS]
    assert set(np.unique(delta)) == {0.0, 1.0}
    assert (expert_steps(scenes, "train", "critical_gap").observation[:, Driving.ENTERS] != delta).any()
