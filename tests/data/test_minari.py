"""The recorded drivers as episodes: what a Minari data set is made of. `make clients` writes and reads one."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from data import minari
from data.minari import expert_episodes
from intersection_env import Replay, Scenes
from intersection_env.features import Driving


def test_recorded_drivers_are_driven_again_by_their_actions() -> None:
    """Step by step as `Replay` gives it, from the start that the options name."""
    environment = Replay("t_junction", split="development")
    episodes = list(expert_episodes("t_junction", "development"))
    actors = environment._worlds.tracks.actors
    assert len(episodes) == len(actors)
    assert len({(one.scene, one.vehicle) for one in episodes}) == len(actors)
    for one in episodes[::40]:
        seen, _ = environment.reset(options={"scene": one.scene, "vehicle": one.vehicle})
        assert (one.observations[0] == seen).all()
        for step, action in enumerate(one.actions):
            seen, reward, terminated, truncated, _ = environment.step(action)
            assert (one.observations[step + 1] == seen).all()
            assert (one.rewards[step], one.terminations[step], one.truncations[step]) == (reward, terminated, truncated)
        assert terminated or truncated
        assert not (one.terminations | one.truncations)[:-1].any()


def test_recorded_drivers_stay_where_they_were_recorded() -> None:
    scenes = Scenes.load("t_junction").select("development")
    apart = []
    for one in expert_episodes(scenes, None):
        track = scenes[one.scene].track(one.vehicle)
        first = int(np.argmax(track.observed))
        recorded = track.speed[first : first + len(one.observations) - 1]
        apart.append(np.abs(one.observations[:-1, Driving.SPEED] - recorded).max())
    assert np.median(apart) < 1e-3
    assert np.quantile(apart, 0.95) < 0.05


def test_command_says_what_to_install(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "minari", None)
    assert minari.main([]) == 1
    assert capsys.readouterr().err.endswith('pip install "minari[hdf5]" pillow\n')


def test_command_names_scenes_that_are_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed = SimpleNamespace(EpisodeBuffer=None)
    monkeypatch.setitem(sys.modules, "minari", installed)
    monkeypatch.setitem(sys.modules, "minari.data_collector", installed)
    assert minari.main(["--scenes", "nowhere"]) == 1
    assert "nowhere" in capsys.readouterr().err
