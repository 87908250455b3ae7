"""The replay through Gymnasium's doors: its checks, determinism, autoreset, pickling, rendering, and bad input."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo

from data.build import build
from data.formats.ind import recording_ids
from intersection_env import Replay, ReplayVector, ReplayWorlds, Scenes
from intersection_env.features import Driving
from intersection_env.scenes.file import pack
from intersection_env.scenes.scenes import RECORDED
from intersection_env.worlds.recorded_tracks import RecordedTracks
from tests.support.episodes import WAYS, as_bytes
from tests.support.episodes import replay_episode as episode
from tests.support.paths import RECORDINGS, ROOT

ID = "intersection_env/Replay-v0"
GAPS = ("recording", "critical_gap", "sumo", "gap")
STILL = np.zeros(1, np.float32)
DIGEST = """
import sys
from tests.envs.test_replay_env import digest
from intersection_env import Replay
print(digest(Replay(), int(sys.argv[1])))
"""


def digest(environment: Replay, seed: int) -> str:
    """A fingerprint of four episodes from one seed."""
    generator = np.random.default_rng(seed)
    found = [as_bytes(environment.reset(seed=seed))]
    for _ in range(4):
        found += [as_bytes(episode(environment, generator)), as_bytes(environment.reset())]
    return hashlib.sha256(b"".join(found)).hexdigest()


def test_scenes_that_ship_are_what_the_recordings_that_ship_give() -> None:
    """Regenerate with `make recorded`. One recording of each split, to spare a minute."""
    recordings = ["05", "13", "17"]
    shipped = Scenes.load("bendplatz")
    fresh = build(RECORDINGS, shipped.intersection, recordings, progress=False)
    assert {scene.split for scene in fresh} == {"train", "development", "validation"}
    arrays = pack(tuple(scene for scene in shipped if scene.recording in recordings))
    for name, values in pack(fresh.scenes).items():
        assert values.dtype == arrays[name].dtype
        assert np.array_equal(values, arrays[name]), name
    about = [one for one in shipped.provenance["recordings"] if one["id"] in recordings]
    assert about == fresh.provenance["recordings"]
    assert shipped.provenance | {"recordings": about} == json.loads(json.dumps(fresh.provenance))
    assert {one["id"] for one in shipped.provenance["recordings"]} == set(recording_ids(RECORDINGS))
    assert (RECORDED / "bendplatz.npz").stat().st_size < 3e6


@pytest.mark.parametrize("gap", GAPS)
def test_environment_passes_gymnasiums_check(gap: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    check_env(gymnasium.make(ID, gap=gap).unwrapped)


def test_id_can_be_made_with_its_module_and_without_an_import() -> None:
    code = 'import gymnasium; print(gymnasium.make("intersection_env:intersection_env/Replay-v0").spec.id)'
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ID


def test_spec_survives_json() -> None:
    environment = gymnasium.make(ID, split="validation", gap="sumo")
    assert environment.spec is not None
    again = EnvSpec.from_json(environment.spec.to_json()).make()
    found = [as_bytes(one.reset(seed=3)) for one in (environment, again)]
    assert found[0] == found[1]
    assert again.unwrapped.scenes[0].split == "validation"  # type: ignore[attr-defined]
    vectors = gymnasium.make_vec(ID, num_envs=3, autoreset_mode="SameStep")
    assert vectors.spec is not None
    assert '"SameStep"' in vectors.spec.to_json()


@pytest.mark.parametrize("gap", GAPS)
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
        assert info["vehicle"] == worlds.tracks.track_id[worlds.track[0]]
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
        scene = environment.scenes[info["scene"]]
        track = scene.track(info["vehicle"])
        first = int(np.argmax(track.observed))
        assert info["time"] == pytest.approx(0.2 * (track.start + first))
        for number, (*_, after) in enumerate(episode(environment, generator), first + 1):
            assert (after["scene"], after["vehicle"]) == (scene.id, track.id)
            assert after["time"] == pytest.approx(0.2 * (track.start + number))
            now = min(number, len(track.speed) - 2)
            step = float(track.speed[now + 1] - track.speed[now]) / 0.2
            assert after["expert_acceleration"] == pytest.approx(step, abs=1e-4)
            assert after["expert_observation"][1] == track.speed[number]


def test_an_episode_begins_where_the_recorded_vehicle_was() -> None:
    environment = Replay()
    environment.reset(seed=5)
    for _ in range(20):
        observation, info = environment.reset()
        assert (observation == info["expert_observation"]).all()
        assert type(info["scene"]) is str
        json.dumps(info | {"expert_observation": info["expert_observation"].tolist()})


def test_whoever_drives_like_the_recorded_vehicle_stays_with_it() -> None:
    environment = Replay()
    environment.reset(seed=6)
    apart = []
    for _ in range(60):
        _, info = environment.reset()
        track = environment.scenes[info["scene"]].track(info["vehicle"])
        speeds = track.speed[int(np.argmax(track.observed)) :]
        for change in np.diff(speeds)[:40]:
            observation, _, terminated, truncated, info = environment.step(np.array([change / 0.2 / 6.0], np.float32))
            apart.append(np.abs(observation - info["expert_observation"])[:2])
            if terminated or truncated:
                break
    assert len(apart) > 1000
    assert (np.max(apart, axis=0) < (0.1, 1e-3)).all()


def test_standing_still_for_ever_ends_with_the_recording() -> None:
    environment = Replay()
    environment.reset(seed=7)
    for _ in range(10):
        _, info = environment.reset()
        track = environment.scenes[info["scene"]].track(info["vehicle"])
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


def test_options_pick_scene_and_vehicle() -> None:
    environment = Replay()
    scene = environment.scenes[4]
    track = next(track for track in scene.tracks if track.observed.sum() > 20)
    number = scene.tracks.index(track)
    given = []
    for options in (
        {"scene": scene.id, "vehicle": track.id},
        {"scene": 4, "vehicle": track.id},
        {"scene": scene.id, "vehicle": number},
        {"scene": 4, "vehicle": number},
        {"scene": np.int64(4), "vehicle": np.int32(number)},
    ):
        observation, info = environment.reset(options=options)
        assert (info["scene"], info["vehicle"]) == (scene.id, track.id)
        given.append(as_bytes([observation, info, episode(environment, np.random.default_rng(0))]))
    assert len(set(given)) == 1
    drawn = set()
    for seed in range(20):
        _, info = environment.reset(seed=seed, options={"scene": 4})
        assert info["scene"] == scene.id
        drawn.add(info["vehicle"])
        assert as_bytes(environment.reset(seed=seed, options={"scene": 4})[1]) == as_bytes(info)
    assert len(drawn) > 3


def test_vehicle_alone_is_enough_where_only_one_scene_has_it() -> None:
    environment = Replay()
    tracks = RecordedTracks.of(environment.scenes)
    ids, counts = np.unique(tracks.track_id[tracks.actors].astype(str), return_counts=True)
    all_counts = {str(id): int((tracks.track_id == id).sum()) for id in ids[:200]}
    alone = next(id for id, count in all_counts.items() if count == 1)
    assert environment.reset(options={"vehicle": alone})[1]["vehicle"] == alone
    twice = next(id for id in tracks.track_id if (tracks.track_id == id).sum() > 1)
    with pytest.raises(ValueError, match=r'is in scenes .*; name one as option "scene"'):
        environment.reset(options={"vehicle": twice})
    assert counts.min() >= 1


def test_bicycles_act_only_if_named() -> None:
    worlds = ReplayWorlds(worlds=512)
    assert not np.isin(worlds.tracks.arrays["track_class"][worlds.tracks.actors], ["bicycle"]).any()
    environment = Replay()
    scene, track = next(
        (scene, track)
        for scene in environment.scenes
        for track in scene.tracks
        if track.road_user == "bicycle" and track.observed.sum() > 10
    )
    observation, info = environment.reset(options={"scene": scene.id, "vehicle": track.id})
    assert info["vehicle"] == track.id
    assert observation[Driving.V_MAX] == 5.0, "a bicycle's own top speed"


@pytest.mark.parametrize("gap", GAPS)
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


def test_same_seed_gives_the_same_episodes_to_the_last_bit_and_another_seed_others() -> None:
    first = digest(Replay(), 7)
    assert digest(Replay(), 7) == first
    assert digest(Replay(), 8) != first


def test_same_seed_gives_the_same_episodes_in_another_process() -> None:
    command = [sys.executable, "-W", "ignore", "-c", DIGEST, "7"]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert found.strip() == digest(Replay(), 7)


@pytest.mark.parametrize("way", WAYS)
def test_copy_made_within_an_episode_goes_on_alike(way: str) -> None:
    environment = Replay(gap="gap", render_mode="rgb_array")
    environment.reset(seed=6)
    episode(environment, np.random.default_rng(1), 4)
    environment.render()
    both = []
    for one in (environment, WAYS[way](environment)):
        generator = np.random.default_rng(2)
        found = [episode(one, generator), one.reset(), episode(one, generator), one.reset(options={"scene": 2})]
        both.append(as_bytes([*found, episode(one, generator)]))
    assert both[0] == both[1]


def test_videos_are_recorded(tmp_path: Path) -> None:
    environment: Any = RecordVideo(gymnasium.make(ID, render_mode="rgb_array"), str(tmp_path / "videos"))
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


def test_render_without_a_mode_warns() -> None:
    for one in (Replay(), ReplayVector(2)):
        one.reset(seed=1)
        with pytest.warns(UserWarning, match="render_mode"):
            assert one.render() is None


BAD_ACTIONS: dict[str, tuple[Any, str]] = {
    "a number": (0.5, "float32, not float"),
    "a list": ([0.5], "float32, not list"),
    "None": (None, "float32, not NoneType"),
    "float64": (np.zeros(1), "float32, not float64"),
    "two numbers": (np.zeros(2, np.float32), r"shape \(1,\), not \(2,\)"),
    "no number": (np.zeros(0, np.float32), r"shape \(1,\), not \(0,\)"),
    "a scalar": (np.array(0, np.float32), r"shape \(1,\), not \(\)"),
    "too large": (np.array([1.5], np.float32), r"1.5; wanted numbers in \[-1, 1\]"),
    "NaN": (np.array([np.nan], np.float32), "nan; wanted"),
    "infinite": (np.array([-np.inf], np.float32), "-inf; wanted"),
}


@pytest.mark.parametrize("case", BAD_ACTIONS)
def test_bad_action_is_refused_and_the_episode_goes_on(case: str) -> None:
    bad, message = BAD_ACTIONS[case]
    environment, other = Replay(), Replay()
    for one in (environment, other):
        one.reset(seed=1)
        one.step(STILL)
    with pytest.raises(InvalidAction, match=message):
        environment.step(bad)
    assert as_bytes(environment.step(STILL)) == as_bytes(other.step(STILL))


def test_action_of_another_library_is_read() -> None:
    environment, other = Replay(), Replay()
    for one in (environment, other):
        one.reset(seed=1)
    tensor: Any = torch.full((1,), 0.25)
    assert as_bytes(environment.step(tensor)) == as_bytes(other.step(np.full(1, 0.25, np.float32)))
    with pytest.raises(InvalidAction, match="float32, not Tensor"):
        environment.step(tensor.requires_grad_())


BAD_OPTIONS: dict[str, tuple[dict[str, Any], str]] = {
    "unknown option": ({"scne": 1}, 'unknown option "scne"'),
    "unknown scene": ({"scene": "99/9"}, "option \"scene\" is '99/9'"),
    "scene number too large": ({"scene": 1000}, 'option "scene" is 1000'),
    "negative scene number": ({"scene": -1}, 'option "scene" is -1'),
    "scene of another type": ({"scene": 1.0}, 'option "scene" is 1.0'),
    "unknown vehicle": ({"scene": 0, "vehicle": "99/99"}, "option \"vehicle\" is '99/99'"),
    "vehicle number too large": ({"scene": 0, "vehicle": 10_000}, 'option "vehicle" is 10000'),
    "unknown vehicle alone": ({"vehicle": "99/99"}, "option \"vehicle\" is '99/99'"),
    "no scene": ({"scene": None, "vehicle": 3}, 'option "scene" is None'),
    "no vehicle": ({"scene": 0, "vehicle": None}, 'option "vehicle" is None'),
    "scene that is a truth": ({"scene": True}, 'option "scene" is True'),
    "vehicle that is a truth": ({"scene": 0, "vehicle": False}, 'option "vehicle" is False'),
    "vehicle number alone": ({"vehicle": 3}, 'option "vehicle" is 3; without a "scene"'),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_bad_option_is_refused_and_the_episode_goes_on(case: str) -> None:
    options, message = BAD_OPTIONS[case]
    environment, other = Replay(), Replay()
    for one in (environment, other):
        one.reset(seed=1)
    with pytest.raises(ValueError, match=message):
        environment.reset(options=options)
    assert as_bytes(environment.step(STILL)) == as_bytes(other.step(STILL))


def test_vehicle_that_is_never_recorded_in_its_scene_cannot_act() -> None:
    environment = Replay()
    scene, track = next(
        (scene, track) for scene in environment.scenes for track in scene.tracks if not track.observed.any()
    )
    with pytest.raises(ValueError, match=f"vehicle {track.id} cannot act"):
        environment.reset(options={"scene": scene.id, "vehicle": track.id})


@pytest.mark.parametrize("kind", [Replay, ReplayVector])
@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scenes": "nowhere"}, FileNotFoundError, '"nowhere": no scenes file'),
        ({"scenes": __file__}, ValueError, "not a scenes file"),
        ({"split": "test"}, ValueError, 'split is "test"'),
        ({"gap": "roulette"}, ValueError, 'gap: .*no policy "roulette"'),
        ({"gap": "idm"}, ValueError, 'the policy "idm" has no gap network'),
        ({"render_mode": "ansi"}, ValueError, "render_mode is 'ansi'"),
    ],
)
def test_bad_argument_is_refused(
    kind: type[Replay | ReplayVector], arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        kind(**arguments)


def test_scenes_of_another_map_or_version_are_refused(tmp_path: Path) -> None:
    scenes = Scenes.load("bendplatz")
    path = tmp_path / "scenes.npz"
    with np.load(RECORDED / "bendplatz.npz") as file:
        arrays = {name: file[name] for name in file.files}
    for old, new, message in (
        ('"version": 1', '"version": 2', '"version" is 2, this package reads 1'),
        (scenes.intersection.checksum, "00000000", "build the scenes again"),
    ):
        np.savez(path, allow_pickle=False, **(arrays | {"header": np.array(str(arrays["header"]).replace(old, new))}))
        with pytest.raises(ValueError, match=message):
            Replay(path)


def test_scenes_can_be_handed_over_and_none_that_act_are_refused() -> None:
    scenes = Scenes.load("bendplatz")
    one = replace(scenes, scenes=scenes.scenes[:1])
    assert Replay(one, split=None).reset(seed=1)[1]["scene"] == scenes[0].id
    empty = replace(scenes.scenes[0], tracks=tuple(replace(t, road_user="bicycle") for t in scenes.scenes[0].tracks))
    with pytest.raises(ValueError, match=r"none of the .* is a car or truck .*\d are, but they are bicycles"):
        Replay(replace(scenes, scenes=(empty,)), split=None)
    with pytest.raises(ValueError, match=r"^the scenes handed over: there are none$"):
        Replay(replace(scenes, scenes=()), split=None)
    with pytest.raises(ValueError, match=r'^the scenes handed over: no scene of split "validation"'):
        Replay(replace(scenes, scenes=scenes.select("train").scenes[:1]), split="validation")


@pytest.mark.parametrize(
    ("seed", "error"), [(-1, Exception), (2**63, ValueError), (1.5, Exception), ("7", Exception), (True, TypeError)]
)
def test_bad_seed_is_refused_and_the_episode_goes_on(seed: Any, error: type[Exception]) -> None:
    environment, other = Replay(), Replay()
    for one in (environment, other):
        one.reset(seed=1)
    with pytest.raises(error, match=r"[Ss]eed"):
        environment.reset(seed=seed)
    assert as_bytes(environment.step(STILL)) == as_bytes(other.step(STILL))


def test_step_and_render_before_the_first_reset_and_step_after_the_end_are_refused() -> None:
    environment = Replay(render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.step(STILL)
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.render()
    environment.reset(seed=1)
    episode(environment, np.random.default_rng(0))
    with pytest.raises(ResetNeeded, match="after an episode's end"):
        environment.step(STILL)
    environment.reset()
    environment.step(STILL)
    envs = ReplayVector(2)
    with pytest.raises(ResetNeeded, match="before the first reset"):
        envs.step(np.zeros((2, 1), np.float32))
    with pytest.raises(ResetNeeded, match="must start all worlds"):
        envs.reset(options={"reset_mask": np.array([True, False])})
