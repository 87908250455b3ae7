"""The replay through Gymnasium's doors: worlds, infos, ends, spaces, and the scenes that ship."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest

from data.build import build, recordings_on
from intersection_env import Replay, ReplayWorlds, Scenes
from intersection_env.features import Driving
from intersection_env.scenes.file import pack
from intersection_env.scenes.scenes import RECORDED
from tests.support.doors import REPLAY_GAPS, episode
from tests.support.paths import ROOT


def test_scenes_that_ship_are_what_the_recordings_that_ship_give() -> None:
    """Regenerate with `make recorded`. One recording of each split, to spare a minute."""
    recordings = ["05", "13", "17"]
    shipped = Scenes.load("bendplatz")
    fresh = build(ROOT / "data" / "recordings", shipped.intersection, recordings, progress=False)
    assert {scene.split for scene in fresh} == {"train", "development", "validation"}
    arrays = pack(tuple(scene for scene in shipped if scene.recording in recordings))
    for name, values in pack(fresh.scenes).items():
        assert values.dtype == arrays[name].dtype
        assert np.array_equal(values, arrays[name]), name
    about = [one for one in shipped.provenance["recordings"] if one["id"] in recordings]
    assert about == fresh.provenance["recordings"]
    assert shipped.provenance | {"recordings": about} == json.loads(json.dumps(fresh.provenance))
    of_bendplatz, elsewhere = recordings_on(ROOT / "data" / "recordings", shipped.intersection)
    assert [one["id"] for one in shipped.provenance["recordings"]] == of_bendplatz
    assert elsewhere, "recordings of the other places lie in the same folder"
    assert (RECORDED / "bendplatz.npz").stat().st_size < 3e6


@pytest.mark.parametrize("gap", REPLAY_GAPS)
def test_environment_is_the_world_that_the_batched_worlds_have(gap: str) -> None:
    environment = Replay(gap=gap)
    worlds = ReplayWorlds(gap=gap, worlds=3)
    observation, info = environment.reset(seed=11)
    worlds.reset(11)
    generator = np.random.default_rng(1)
    for _ in range(400):
        assert (observation == worlds.observation[0]).all()
        assert (info["expert_observation"] == worlds.expert_observation[0]).all()
        assert info["expert_acceleration"] == worlds.expert_acceleration[0]
        scene, vehicle = environment.names(info)
        assert vehicle == worlds.tracks.track_id[worlds.track[0]]
        assert scene == worlds.tracks.scene_id[worlds.track[0]]
        action = generator.uniform(-0.4, 0.4, 1).astype(np.float32)
        worlds.action[:] = action
        worlds.step()
        observation, reward, terminated, truncated, info = environment.step(action)
        assert (reward, terminated, truncated) == (worlds.reward[0], worlds.terminated[0], worlds.truncated[0])
        if terminated or truncated:
            assert (observation == worlds.final_observation[0]).all()
            observation, info = environment.reset()


def test_infos_are_those_of_the_recording() -> None:
    environment = Replay()
    environment.reset(seed=5)
    generator = np.random.default_rng(0)
    for _ in range(10):
        _, info = environment.reset()
        scene = environment.scenes[int(info["scene"])]
        track = scene.tracks[info["vehicle"]]
        first = int(np.argmax(track.observed))
        assert info["time"] == pytest.approx(0.2 * (track.start + first))
        for number, (*_, after) in enumerate(episode(environment, generator), first + 1):
            assert environment.names(after) == (scene.id, track.id)
            assert after["time"] == pytest.approx(0.2 * (track.start + number))
            now = min(number, len(track.speed) - 2)
            step = float(track.speed[now + 1] - track.speed[now]) / 0.2
            assert after["expert_acceleration"] == pytest.approx(step, abs=1e-4)
            assert after["expert_observation"][Driving.SPEED] == track.speed[number]


def test_an_episode_begins_where_the_recorded_vehicle_was() -> None:
    environment = Replay()
    environment.reset(seed=5)
    for _ in range(20):
        observation, info = environment.reset()
        assert (observation == info["expert_observation"]).all()
        json.dumps({name: value.tolist() for name, value in info.items()})


def test_infos_are_numpys_of_the_types_that_the_manual_names() -> None:
    environment = Replay()
    rows = re.findall(r"^ *\| `(\w+)` \| (?:\(12,\) )?(\w+) \| .* \|$", str(Replay.__doc__), flags=re.MULTILINE)
    wanted = dict(rows[: len(environment.reset(seed=1)[1])])
    *_, after = environment.step(np.zeros(1, np.float32))
    for info in (environment.reset()[1], after):
        assert {name: value.dtype.name for name, value in info.items()} == wanted
        assert {name: np.shape(value) for name, value in info.items()} == {
            name: (12,) if name == "expert_observation" else () for name in wanted
        }


def test_numbers_of_an_info_name_its_start_again() -> None:
    environment = Replay()
    observation, info = environment.reset(seed=9)
    environment.reset()
    numbers = {name: info[name] for name in ("scene", "vehicle")}
    ids = dict(zip(numbers, environment.names(info), strict=True))
    for options in (numbers, ids):
        again, info_again = environment.reset(options=options)
        assert (again == observation).all()
        assert environment.names(info_again) == environment.names(info)


def test_whoever_drives_like_the_recorded_vehicle_stays_with_it() -> None:
    environment = Replay()
    environment.reset(seed=6)
    apart, columns = [], [Driving.DISTANCE_TO_STOP_LINE, Driving.SPEED]
    for _ in range(60):
        _, info = environment.reset()
        track = environment.scenes[int(info["scene"])].tracks[info["vehicle"]]
        speeds = track.speed[int(np.argmax(track.observed)) :]
        for change in np.diff(speeds)[:40]:
            observation, _, terminated, truncated, info = environment.step(np.array([change / 0.2 / 6.0], np.float32))
            apart.append(np.abs(observation - info["expert_observation"])[columns])
            if terminated or truncated:
                break
    assert len(apart) > 1000
    assert (np.max(apart, axis=0) < (0.1, 1e-3)).all()


def test_standing_still_for_ever_ends_with_the_recording() -> None:
    environment = Replay()
    environment.reset(seed=7)
    for _ in range(10):
        _, info = environment.reset()
        track = environment.scenes[int(info["scene"])].tracks[info["vehicle"]]
        steps = 0
        while True:
            *_, terminated, truncated, info = environment.step(np.array([-1.0], np.float32))
            steps += 1
            if terminated or truncated:
                break
        assert terminated or steps == len(track.position) - 1 - int(np.argmax(track.observed))


def test_collision_terminates_with_its_penalty() -> None:
    environment = Replay()
    environment.reset(seed=8)
    found = 0
    for _ in range(150):
        environment.reset()
        while True:
            _, reward, terminated, truncated, _ = environment.step(np.array([0.2], np.float32))
            assert (reward < -4500.0) == terminated
            assert not (terminated and truncated)
            if terminated or truncated:
                found += terminated
                break
    assert found > 10


@pytest.mark.parametrize("gap", REPLAY_GAPS)
def test_observations_stay_within_their_space(gap: str) -> None:
    environment = Replay(gap=gap)
    space: Any = environment.observation_space
    worlds = ReplayWorlds(gap=gap, worlds=256)
    worlds.reset(4)
    generator = np.random.default_rng(4)
    seen = []
    for _ in range(40):
        worlds.action[:] = np.sign(generator.normal(0.5, 1.0, 256))
        for _ in range(8):
            worlds.step()
            done = worlds.terminated | worlds.truncated
            seen += [worlds.observation.copy(), worlds.final_observation[done], worlds.expert_observation.copy()]
    table = np.concatenate(seen)
    assert np.isfinite(table).all()
    assert (table >= space.low).all(), table.min(axis=0)
    assert (table <= space.high).all(), table.max(axis=0)
