"""The replay of many worlds: Gymnasium's autoreset modes, masked resets, pickling, and bad input."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from intersection_env import Replay, ReplayVector
from tests.support.episodes import WAYS, as_bytes

ID = "intersection_env/Replay-v0"


def test_threads_change_nothing() -> None:
    results = []
    for threads in (1, 2):
        envs = ReplayVector(40, threads=threads)
        found: list[Any] = [envs.reset(seed=5)]
        generator = np.random.default_rng(0)
        found += [envs.step(generator.uniform(-0.4, 0.4, (40, 1)).astype(np.float32)) for _ in range(60)]
        results.append(as_bytes(found))
    assert results[0] == results[1]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_copy_of_many_worlds_goes_on_alike(way: str, mode: str) -> None:
    envs = ReplayVector(6, autoreset_mode=mode)
    envs.reset(seed=1)
    for _ in range(37):
        envs.step(np.zeros((6, 1), np.float32))
    both = []
    for one in (envs, WAYS[way](envs)):
        both.append(as_bytes([one.step(np.full((6, 1), 0.1, np.float32)) for _ in range(80)]))
    assert both[0] == both[1]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_one_world_of_the_vector_is_gymnasiums_own_vector_of_one(mode: str) -> None:
    """Infos included, in the structure that Gymnasium gives them."""
    own = gymnasium.make_vec(ID, num_envs=1, autoreset_mode=mode)
    plain = SyncVectorEnv([lambda: gymnasium.make(ID)], autoreset_mode=mode)
    assert isinstance(own.unwrapped, ReplayVector)
    assert own.observation_space == plain.observation_space
    assert own.action_space == plain.action_space
    generator = np.random.default_rng(0)
    found: list[Any] = [(own.reset(seed=3), plain.reset(seed=3))]
    ended = 0
    for _ in range(400):
        action = generator.uniform(-0.4, 0.4, (1, 1)).astype(np.float32)
        found.append((own.step(action), plain.step(action)))
        ended += int(found[-1][0][3][0])
    assert ended > 5
    for one, other in found:
        assert as_sorted(one) == as_sorted(other)


def as_sorted(thing: Any) -> Any:
    """Nested dicts and arrays as lists that can be compared, types included."""
    if isinstance(thing, dict):
        return [(key, as_sorted(thing[key])) for key in sorted(thing)]
    if isinstance(thing, tuple | list):
        return [as_sorted(one) for one in thing]
    if isinstance(thing, np.ndarray):
        return [str(thing.dtype), thing.shape, [as_sorted(one) for one in thing.tolist()]]
    return thing


def test_next_step_autoreset_ignores_the_action_of_the_restart() -> None:
    envs = ReplayVector(64)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    envs.reset(seed=2)
    restarted = np.zeros(64, np.bool_)
    seen = 0
    for _ in range(120):
        observation, reward, terminated, truncated, infos = envs.step(np.full((64, 1), 0.5, np.float32))
        assert (reward[restarted] == 0.0).all()
        assert not (terminated | truncated)[restarted].any()
        assert (observation[restarted] == infos["expert_observation"][restarted]).all()
        seen += int(restarted.sum())
        restarted = terminated | truncated
    assert seen > 50


def test_same_step_autoreset_gives_the_new_start_and_keeps_the_end() -> None:
    envs = ReplayVector(64, autoreset_mode=AutoresetMode.SAME_STEP)
    others = ReplayVector(64, autoreset_mode="NextStep")
    envs.reset(seed=2)
    others.reset(seed=2)
    action = np.full((64, 1), 0.3, np.float32)
    is_first = np.ones(64, np.bool_)
    ended = 0
    for _ in range(20):
        observation, reward, terminated, truncated, infos = envs.step(action)
        last, reward_too, *_, infos_too = others.step(action)
        done = terminated | truncated
        assert (reward[is_first] == reward_too[is_first]).all()
        assert (observation[is_first & ~done] == last[is_first & ~done]).all()
        for world in np.flatnonzero(done & is_first):
            assert (infos["final_obs"][world] == last[world]).all()
            for name in ("expert_observation", "expert_acceleration", "scene", "vehicle", "time"):
                assert np.array_equal(infos["final_info"][name][world], infos_too[name][world])
                assert infos["final_info"][f"_{name}"][world]
        assert (observation[done] == infos["expert_observation"][done]).all()
        assert ("final_obs" in infos) == done.any()
        ended += int((done & is_first).sum())
        is_first &= ~done
    assert ended > 5


def test_disabled_autoreset_waits_for_the_reset_of_those_that_ended() -> None:
    envs = ReplayVector(16, autoreset_mode="Disabled")
    envs.reset(seed=3)
    action = np.full((16, 1), 0.5, np.float32)
    done = np.zeros(16, np.bool_)
    while not done.any():
        before, _, terminated, truncated, _ = envs.step(action)
        done = terminated | truncated
    with pytest.raises(ResetNeeded, match="reset_mask"):
        envs.step(action)
    options = {"reset_mask": done}
    observation, infos = envs.reset(options=options)
    assert options == {"reset_mask": done}
    assert (observation[~done] == before[~done]).all()
    assert (observation[done] == infos["expert_observation"][done]).all()
    assert (infos["_scene"] == done).all()
    assert not infos["expert_observation"][~done].any()
    envs.step(action)


def test_masked_reset_with_a_seed_starts_the_masked_worlds_as_the_seed_says() -> None:
    envs, others = ReplayVector(8), ReplayVector(8)
    envs.reset(seed=1)
    mask = np.arange(8) < 3
    observation, _ = envs.reset(seed=9, options={"reset_mask": mask})
    assert (observation[mask] == others.reset(seed=9)[0][mask]).all()
    assert (observation[~mask] == others.reset(seed=1)[0][~mask]).all()


def test_every_world_of_the_vector_has_a_stream_of_its_own() -> None:
    _, infos = ReplayVector(64).reset(seed=1)
    assert len(set(zip(infos["scene"], infos["vehicle"], strict=True))) > 48


def test_each_world_of_listed_seeds_is_the_replay_with_its_own() -> None:
    """And goes on as that one does, episode after episode; a world without a seed goes on where it was."""
    seeds = [7, None, 3, 7]
    envs, before = ReplayVector(4), ReplayVector(4)
    for vector in (envs, before):
        vector.reset(seed=1)
    observation, infos = envs.reset(seed=seeds)
    assert (observation[1] == before.reset()[0][1]).all()
    replays = [(world, seed, Replay()) for world, seed in enumerate(seeds) if seed is not None]
    for world, seed, one in replays:
        assert (observation[world] == one.reset(seed=seed)[0]).all()
    assert envs.names(infos)[0] == envs.names(infos)[3]
    was_done = np.zeros(4, np.bool_)
    ends = 0
    generator = np.random.default_rng(0)
    for _ in range(150):
        action = generator.uniform(-0.4, 0.4, (4, 1)).astype(np.float32)
        observation, reward, terminated, truncated, infos = envs.step(action)
        for world, _, one in replays:
            if was_done[world]:
                seen, info = one.reset()
            else:
                seen, paid, *_, info = one.step(action[world])
                assert reward[world] == paid
            assert (observation[world] == seen).all()
            assert envs.names(infos)[world] == one.names(info)
        was_done = terminated | truncated
        ends += int(was_done.sum())
    assert ends > 4


def test_listed_seeds_start_the_masked_worlds_alone() -> None:
    envs, others = ReplayVector(3), ReplayVector(3)
    for one in (envs, others):
        one.reset(seed=1)
    observation, _ = envs.reset(seed=[4, 5, 6], options={"reset_mask": np.array([True, False, True])})
    plain, _ = others.reset(seed=[4, 5, 6])
    assert (observation[[0, 2]] == plain[[0, 2]]).all()
    assert (observation[1] == ReplayVector(3).reset(seed=1)[0][1]).all()


@pytest.mark.parametrize(
    ("seed", "error", "message"),
    [
        ([1, 2], ValueError, "^there are 2 seeds; wanted one for each of the 3 worlds$"),
        ([1, 2.0, 3], TypeError, "^seed is 2.0; wanted a whole number$"),
        ([1, None, -1], ValueError, "^seed is -1; wanted 0 to 2"),
        (2.0, TypeError, "^seed is 2.0; wanted a whole number$"),
    ],
)
def test_bad_seeds_of_a_vector_are_refused(seed: Any, error: type[Exception], message: str) -> None:
    envs = ReplayVector(3)
    with pytest.raises(error, match=message):
        envs.reset(seed=seed)


def test_seeds_determine_the_generator_for_wrappers() -> None:
    drawn = []
    for seed in (5, 5, [5, 6], [5, 6], [6, None]):
        envs = ReplayVector(2)
        envs.reset(seed=seed)
        drawn.append(envs.np_random.random())
    assert drawn[0] == drawn[1]
    assert drawn[2] == drawn[3]
    assert len(set(drawn)) == 3


@pytest.mark.parametrize("bad", [np.zeros((4, 1)), np.zeros(4, np.float32), np.full((4, 1), np.nan, np.float32)])
def test_bad_actions_of_a_vector_are_refused_and_the_episodes_go_on(bad: NDArray[Any]) -> None:
    envs, others = ReplayVector(4), ReplayVector(4)
    good = np.zeros((4, 1), np.float32)
    for one in (envs, others):
        one.reset(seed=1)
    with pytest.raises(InvalidAction):
        envs.step(bad)
    assert as_bytes(envs.step(good)) == as_bytes(others.step(good))


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"scene": 1}, ValueError),
        ({"reset_mask": [True] * 4}, TypeError),
        ({"reset_mask": np.ones(4, np.int8)}, TypeError),
        ({"reset_mask": np.ones(3, np.bool_)}, ValueError),
        ({"reset_mask": np.zeros(4, np.bool_)}, ValueError),
    ],
)
def test_bad_option_of_a_vector_is_refused(options: dict[str, Any], error: type[Exception]) -> None:
    envs = ReplayVector(4)
    envs.reset(seed=1)
    with pytest.raises(error, match=r"option"):
        envs.reset(options=options)
    envs.step(np.zeros((4, 1), np.float32))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "worlds"),
        ({"autoreset_mode": "later"}, "later"),
        ({"max_episode_steps": 0}, "max_episode_steps is 0"),
    ],
)
def test_bad_argument_of_a_vector_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ReplayVector(**arguments)


@pytest.mark.parametrize("name", ["num_envs", "threads", "max_episode_steps"])
@pytest.mark.parametrize("value", [2.0, "3", True])
def test_count_of_a_vector_that_is_no_whole_number_is_refused(name: str, value: Any) -> None:
    with pytest.raises(TypeError, match=f"^{name} is {value!r}; wanted a whole number$"):
        ReplayVector(**{name: value})


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_step_limit_of_one_world_is_that_of_gymnasiums_own_vector(mode: str) -> None:
    own = gymnasium.make_vec(ID, num_envs=1, autoreset_mode=mode, max_episode_steps=10)
    plain = SyncVectorEnv([lambda: gymnasium.make(ID, max_episode_steps=10)], autoreset_mode=mode)
    generator = np.random.default_rng(0)
    assert as_sorted(own.reset(seed=3)) == as_sorted(plain.reset(seed=3))
    lengths, begin = set(), 0
    for step in range(200):
        action = generator.uniform(-0.4, 0.4, (1, 1)).astype(np.float32)
        one, other = own.step(action), plain.step(action)
        assert as_sorted(one) == as_sorted(other)
        if one[2][0] or one[3][0]:
            lengths.add(step - begin)
            begin = step
    assert max(lengths) == (11 if mode == "NextStep" else 10)
    assert len(lengths) > 1


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_step_limit_holds_for_each_world_by_itself(mode: str) -> None:
    envs = ReplayVector(32, autoreset_mode=mode, max_episode_steps=10)
    envs.reset(seed=4)
    elapsed = np.zeros(32, np.int64)
    was_done = np.zeros(32, np.bool_)
    reached = 0
    for step in range(60):
        if step == 5:
            mask = np.arange(32) < 8
            envs.reset(options={"reset_mask": mask | was_done})
            elapsed[mask | was_done] = 0
            was_done[:] = False
        elif mode == "Disabled" and was_done.any():
            envs.reset(options={"reset_mask": was_done})
            elapsed[was_done] = 0
        *_, terminated, truncated, infos = envs.step(np.full((32, 1), 0.3, np.float32))
        done = terminated | truncated
        elapsed = np.where(was_done & (mode == "NextStep"), 0, elapsed + 1)
        assert truncated[elapsed >= 10].all()
        assert (elapsed <= 10).all()
        reached += int((elapsed == 10).sum())
        if mode == "SameStep":
            elapsed[done] = 0
            assert ("final_obs" in infos) == done.any()
        was_done = done
    assert reached > 50
