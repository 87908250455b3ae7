"""Which scenes are replayed and who acts, by arguments and options; and bad ones."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from agents.rollouts.envs import ReplayEnv
from intersection_env import Intersection, Replay, ReplayVector, ReplayWorlds, Scenes
from intersection_env.features import Driving
from intersection_env.scenes.scenes import RECORDED
from intersection_env.worlds.recorded_tracks import RecordedTracks
from tests.support.doors import STILL, episode
from tests.support.episodes import as_bytes
from tests.support.own_place import own_scenes


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
        assert environment.names(info) == (scene.id, track.id)
        given.append(as_bytes([observation, info, episode(environment, np.random.default_rng(0))]))
    assert len(set(given)) == 1
    drawn = set()
    for seed in range(20):
        _, info = environment.reset(seed=seed, options={"scene": 4})
        assert environment.names(info)[0] == scene.id
        drawn.add(info["vehicle"])
        assert as_bytes(environment.reset(seed=seed, options={"scene": 4})[1]) == as_bytes(info)
    assert len(drawn) > 3


def test_vehicle_alone_is_enough_where_only_one_scene_has_it() -> None:
    environment = Replay()
    tracks = RecordedTracks.of(environment.scenes)
    ids, counts = np.unique(tracks.track_id[tracks.actors].astype(str), return_counts=True)
    all_counts = {str(id): int((tracks.track_id == id).sum()) for id in ids[:200]}
    alone = next(id for id, count in all_counts.items() if count == 1)
    assert environment.names(environment.reset(options={"vehicle": alone})[1])[1] == alone
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
    assert environment.names(info)[1] == track.id
    assert observation[Driving.V_MAX] == 5.0, "a bicycle's own top speed"


# Bad options and arguments


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
    environment = Replay(one, split=None)
    assert environment.names(environment.reset(seed=1)[1])[0] == scenes[0].id
    empty = replace(scenes.scenes[0], tracks=tuple(replace(t, road_user="bicycle") for t in scenes.scenes[0].tracks))
    with pytest.raises(ValueError, match=r"none of the .* is a car or truck .*\d are, but they are bicycles"):
        Replay(replace(scenes, scenes=(empty,)), split=None)
    with pytest.raises(ValueError, match=r"^the scenes handed over: there are none$"):
        Replay(replace(scenes, scenes=()), split=None)
    with pytest.raises(ValueError, match=r'^the scenes handed over: no scene of split "validation"'):
        Replay(replace(scenes, scenes=scenes.select("train").scenes[:1]), split="validation")


def test_scenes_on_a_map_of_ones_own_come_through_every_door(tmp_path: Path) -> None:
    scenes, file = own_scenes(tmp_path)
    wanted = Scenes.load(scenes, file)
    for map in (file, str(file), Intersection.load(file)):
        single = gymnasium.make("intersection_env/Replay-v0", scenes=scenes, map=map)
        vector = gymnasium.make_vec("intersection_env/Replay-v0", num_envs=2, scenes=str(scenes), map=map)
        observation, info = single.reset(seed=3)
        observations, infos = vector.reset(seed=3)
        np.testing.assert_array_equal(observations[0], observation)
        assert info["vehicle"] == infos["vehicle"][0]
        assert single.observation_space.contains(observation)
        worlds = ReplayWorlds(scenes, map=map, worlds=2)
        worlds.reset(3)
        np.testing.assert_array_equal(worlds.observation, observations)
        assert worlds.intersection == wanted.intersection
        again = pickle.loads(pickle.dumps(worlds))
        assert again.intersection == wanted.intersection
        assert ReplayEnv(scenes, map=map, worlds=2).worlds.intersection.name == "mine"
        assert Replay(wanted, map=map).scenes.intersection == wanted.intersection


@pytest.mark.parametrize("kind", [Replay, ReplayVector, ReplayWorlds])
def test_map_that_is_not_that_of_the_scenes_is_refused(
    kind: type[Replay | ReplayVector | ReplayWorlds], tmp_path: Path
) -> None:
    scenes, file = own_scenes(tmp_path, "00")
    with pytest.raises(ValueError, match=r'mine\.npz: its map "mine" does not ship; give it: --map .*, in Python map='):
        kind(scenes=scenes)
    with pytest.raises(ValueError, match='made on map "mine", not on map "t_junction"'):
        kind(scenes=scenes, map="t_junction")
    with pytest.raises(ValueError, match=r'map: the scenes handed over lie on map "mine" .* not on "bendplatz"'):
        kind(scenes=Scenes.load(scenes, file), map="bendplatz")
    with pytest.raises(ValueError, match='no map "nowhere" ships'):
        kind(scenes=scenes, map="nowhere")
