"""The closed loop through PettingZoo's doors: its checks, determinism, pickling, rendering, and bad input."""

from __future__ import annotations

import hashlib
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pettingzoo
import pettingzoo.test
import pytest
import torch
from gymnasium.error import InvalidAction, ResetNeeded
from pettingzoo.utils.wrappers import RecordVideoParallel

from intersection_env import ClosedLoop, ClosedLoopWorlds, Intersection, env, parallel_env
from tests.conftest import MAP_NAMES
from tests.support.episodes import WAYS, as_bytes, gentle
from tests.support.episodes import closed_loop_episode as episode
from tests.support.paths import ROOT
from tests.support.single_lane_junction import single_lane_source

CHECKS: Any = pettingzoo.test  # without annotations
GAPS = ("critical_gap", "sumo", "gap")
DIGEST = """
import sys
from tests.envs.test_closed_loop_env import digest
from intersection_env import parallel_env
print(digest(parallel_env(), int(sys.argv[1])))
"""


def digest(environment: ClosedLoop, seed: int) -> str:
    """A fingerprint of three episodes from one seed."""
    generator = np.random.default_rng(seed)
    found = [as_bytes(environment.reset(seed=seed))]
    for _ in range(3):
        found += [as_bytes(episode(environment, generator)), as_bytes(environment.reset())]
    return hashlib.sha256(b"".join(found)).hexdigest()


def seeded(make: Callable[..., Any]) -> Callable[..., Any]:
    """The same environment, no longer left to chance where a check neither seeds it nor its spaces."""

    def made(**arguments: Any) -> Any:
        environment = make(**arguments)
        environment.reset(seed=5)
        for number, agent in enumerate(environment.possible_agents):
            environment.action_space(agent).seed(number)
        return environment

    return made


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("name", MAP_NAMES)
def test_parallel_environment_passes_pettingzoos_checks(name: str, gap: str) -> None:
    CHECKS.parallel_api_test(parallel_env(map=name, gap=gap), num_cycles=300)


def test_turn_based_environment_passes_pettingzoos_checks() -> None:
    CHECKS.api_test(env(), num_cycles=300)


def test_seeding_passes_pettingzoos_checks() -> None:
    CHECKS.parallel_seed_test(parallel_env)
    CHECKS.seed_test(env)


def test_max_cycles_passes_pettingzoos_check() -> None:
    few: dict[str, Any] = {"vehicles": 3}
    doors = {
        "parallel_env": seeded(lambda **own: parallel_env(**few, **own)),
        "env": seeded(lambda **o: env(**few, **o)),
    }
    CHECKS.max_cycles_test(SimpleNamespace(**doors))


def test_rendering_passes_pettingzoos_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    CHECKS.render_test(env)


def test_registry_makes_both_forms() -> None:
    parallel = pettingzoo.make("parallel", "intersection_env/ClosedLoop-v0", vehicles=3)
    turns = pettingzoo.make("aec", "intersection_env/ClosedLoop-v0", map="t_junction")
    assert isinstance(parallel, ClosedLoop)
    assert parallel.possible_agents == ["vehicle_0", "vehicle_1", "vehicle_2"]
    assert isinstance(turns.unwrapped, ClosedLoop)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("name", MAP_NAMES)
def test_world_is_the_one_that_the_batched_worlds_have(name: str, gap: str) -> None:
    environment = parallel_env(map=name, gap=gap, max_cycles=60)
    worlds = ClosedLoopWorlds(name, gap=gap, max_cycles=60, worlds=3)
    observations, _ = environment.reset(seed=11)
    worlds.reset(11)
    generator = np.random.default_rng(1)
    ended = 0
    for _ in range(400):
        assert (np.stack(list(observations.values())) == worlds.observation[0]).all()
        actions = gentle(environment, generator)
        worlds.action[:] = np.concatenate(list(actions.values()))
        worlds.step()
        observations, rewards, terminations, truncations, infos = environment.step(actions)
        assert list(rewards.values()) == worlds.reward[0].tolist()
        assert list(terminations.values()) == worlds.terminated[0].tolist()
        assert list(truncations.values()) == worlds.truncated[0].tolist()
        assert [bool(info) for info in infos.values()] == worlds.reinserted[0].tolist()
        if not environment.agents:
            ended += 1
            assert (np.stack(list(observations.values())) == worlds.final_observation[0]).all()
            observations, _ = environment.reset()
    assert ended > 3


def test_collision_terminates_who_is_to_blame_and_truncates_the_others() -> None:
    environment = parallel_env()
    environment.reset(seed=0)
    generator = np.random.default_rng(0)
    collisions = 0
    for _ in range(40):
        *_, last = episode(environment, generator)
        _, rewards, terminations, truncations, _ = last
        assert all(terminations[agent] != truncations[agent] for agent in terminations)
        for agent in terminations:
            assert (rewards[agent] < -4000.0) == terminations[agent]
        collisions += any(terminations.values())
        environment.reset()
    assert collisions > 5


def test_reinserted_vehicle_is_flagged_with_what_it_saw_last() -> None:
    environment = parallel_env(vehicles=3)
    environment.reset(seed=2)
    generator = np.random.default_rng(2)
    found = 0
    for _ in range(60):
        for observations, *_, infos in episode(environment, generator, 300):
            for agent, info in infos.items():
                if info:
                    found += 1
                    assert info["reinserted"] is True
                    assert observations[agent][0] > 0.0, "back before the line"
                    assert info["final_observation"][0] < 0.0, "was beyond it"
        environment.reset()
    assert found > 5


def test_max_cycles_ends_the_world_and_a_change_counts_from_the_next_reset() -> None:
    environment = parallel_env(vehicles=1, max_cycles=7)
    environment.reset(seed=3)
    environment.max_cycles = 4
    assert len(episode(environment, np.random.default_rng(0))) == 7
    environment.reset()
    *_, last = steps = episode(environment, np.random.default_rng(0))
    assert len(steps) == 4
    assert last[3] == {"vehicle_0": True}


def test_observations_stay_within_their_space(intersection: Intersection) -> None:
    """With the wildest driving: full throttle and full braking for long stretches, also backwards."""
    environment = parallel_env(intersection, vehicles=6)
    space = environment.observation_space("vehicle_0")
    worlds = ClosedLoopWorlds(intersection, worlds=64, vehicles=2, autoreset="same_step")
    worlds.reset(4)
    generator = np.random.default_rng(4)
    seen = []
    for _ in range(150):
        worlds.action[:] = np.sign(generator.normal(0.3, 1.0, (64, 1)))
        for _ in range(10):
            worlds.step()
            cut = worlds.terminated | worlds.truncated | worlds.reinserted
            seen += [worlds.observation.reshape(-1, 12).copy(), worlds.final_observation[cut].copy()]
    table = np.concatenate(seen)
    assert np.isfinite(table).all()
    assert (table >= space.low).all(), table.min(axis=0)
    assert (table <= space.high).all(), table.max(axis=0)
    assert table[:, 1].max() > 25.0


def test_same_seed_gives_the_same_episodes_to_the_last_bit_and_another_seed_others() -> None:
    first = digest(parallel_env(), 7)
    assert digest(parallel_env(), 7) == first
    assert digest(parallel_env(), 8) != first


def test_same_seed_gives_the_same_episodes_in_another_process() -> None:
    command = [sys.executable, "-W", "ignore", "-c", DIGEST, "7"]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert found.strip() == digest(parallel_env(), 7)


def test_threads_change_nothing() -> None:
    results = []
    for threads in (1, 2):
        worlds = ClosedLoopWorlds(worlds=40, threads=threads)
        worlds.reset(5, desynchronise=True)
        generator = np.random.default_rng(0)
        for _ in range(50):
            worlds.action[:] = generator.uniform(-0.3, 0.3, worlds.action.shape)
            worlds.step()
        results.append(as_bytes(worlds.state()) + worlds.reward.tobytes())
    assert results[0] == results[1]


@pytest.mark.parametrize("way", WAYS)
def test_copy_made_within_an_episode_goes_on_alike(way: str) -> None:
    environment = parallel_env(gap="sumo", render_mode="rgb_array")
    environment.reset(seed=6)
    episode(environment, np.random.default_rng(1), 5)
    environment.render()
    other = WAYS[way](environment)
    assert other.agents == environment.agents
    both = []
    for one in (environment, other):
        generator = np.random.default_rng(2)
        both.append(as_bytes([episode(one, generator), one.reset(), episode(one, generator)]))
    assert both[0] == both[1]


def test_environment_can_be_pickled_before_its_first_reset() -> None:
    other = pickle.loads(pickle.dumps(parallel_env()))
    assert digest(other, 7) == digest(parallel_env(), 7)


def test_batched_worlds_go_on_alike_after_pickling() -> None:
    worlds = ClosedLoopWorlds(worlds=5, vehicles=8, autoreset="next_step")
    worlds.reset(1)
    for _ in range(60):
        worlds.step()
    other = pickle.loads(pickle.dumps(worlds))
    assert (other.observation == worlds.observation).all()
    for one in (worlds, other):
        for _ in range(60):
            one.step()
    assert as_bytes(other.state()) == as_bytes(worlds.state())


def test_what_was_handed_out_never_changes() -> None:
    environment = parallel_env()
    given = [environment.reset(seed=1)]
    before = as_bytes(given)
    steps = episode(environment, np.random.default_rng(0), 3)
    kept = as_bytes(steps)
    episode(environment, np.random.default_rng(0))
    environment.reset()
    assert as_bytes(given) == before
    assert as_bytes(steps) == kept


def test_videos_are_recorded(tmp_path: Path) -> None:
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


def test_render_without_a_mode_warns() -> None:
    environment = parallel_env()
    environment.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode"):
        assert environment.render() is None


GOOD = np.zeros(1, np.float32)
BAD_ACTIONS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no dict": (lambda good: list(good.values()), "must be a dict from agent to action, not list"),
    "an agent missing": (lambda good: {name: good[name] for name in list(good)[1:]}, "no action for vehicle_0"),
    "an unknown agent": (lambda good: good | {"bicycle": GOOD}, "unknown agent 'bicycle'"),
    "an agent instead of another": (
        lambda good: {name: good[name] for name in list(good)[1:]} | {"bicycle": GOOD},
        "no action for vehicle_0",
    ),
    "a number": (lambda good: good | {"vehicle_3": 0.5}, "vehicle_3: .*not float"),
    "None": (lambda good: good | {"vehicle_3": None}, "vehicle_3: .*not NoneType"),
    "a list": (lambda good: good | {"vehicle_3": [0.5]}, "vehicle_3: .*not list"),
    "float64": (lambda good: good | {"vehicle_3": np.zeros(1)}, "vehicle_3: .*not float64"),
    "a scalar": (lambda good: good | {"vehicle_3": np.array(0, np.float32)}, r"vehicle_3: .*\(1,\), not \(\)"),
    "two numbers": (lambda good: good | {"vehicle_3": np.zeros(2, np.float32)}, r"vehicle_3: .*not \(2,\)"),
    "two axes": (lambda good: good | {"vehicle_3": np.zeros((1, 1), np.float32)}, r"vehicle_3: .*not \(1, 1\)"),
    "two for one and none for another": (
        lambda good: good | {"vehicle_3": np.zeros(2, np.float32), "vehicle_4": np.zeros(0, np.float32)},
        r"vehicle_3: .*not \(2,\)",
    ),
    "too large": (lambda good: good | {"vehicle_3": np.array([1.5], np.float32)}, r"vehicle_3: .*1.5.*\[-1, 1\]"),
    "NaN": (lambda good: good | {"vehicle_3": np.array([np.nan], np.float32)}, "vehicle_3: .*nan"),
    "infinite": (lambda good: good | {"vehicle_0": np.array([-np.inf], np.float32)}, "vehicle_0: .*-inf"),
}


@pytest.mark.parametrize("case", BAD_ACTIONS)
def test_bad_action_is_refused_and_the_episode_goes_on(case: str) -> None:
    spoil, message = BAD_ACTIONS[case]
    environment, other = parallel_env(), parallel_env()
    good = dict.fromkeys(environment.possible_agents, GOOD)
    for one in (environment, other):
        one.reset(seed=1)
        one.step(good)
    with pytest.raises(InvalidAction, match=message):
        environment.step(spoil(good))
    assert as_bytes(environment.step(good)) == as_bytes(other.step(good))


def test_action_of_another_library_is_read_and_a_list_is_not() -> None:
    environment, other = parallel_env(), parallel_env()
    good = dict.fromkeys(environment.possible_agents, np.full(1, 0.25, np.float32))
    for one in (environment, other):
        one.reset(seed=1)
    tensors: dict[str, Any] = dict.fromkeys(good, torch.full((1,), 0.25))
    assert as_bytes(environment.step(tensors)) == as_bytes(other.step(good))
    bad: Any
    tensor: Any = torch.zeros(1, dtype=torch.float64)
    for bad, message in (
        (tensor, "float64"),
        ([np.float32(0.25)], "list"),
        (torch.zeros(1, requires_grad=True), "Tensor"),
    ):
        with pytest.raises(InvalidAction, match=f"vehicle_3: .*not {message}"):
            environment.step(good | {"vehicle_3": bad})


def test_infos_are_empty_but_after_a_reset_and_at_a_reinsertion() -> None:
    environment = parallel_env()
    observations, infos = environment.reset(seed=1)
    for agent in environment.possible_agents:
        assert infos[agent]["reinserted"] is False
        assert (infos[agent]["final_observation"] == observations[agent]).all()
    *_, infos = environment.step(dict.fromkeys(environment.possible_agents, GOOD))
    assert list(infos.values()) == [{}] * 12


def test_end_can_be_brought_forward_within_an_episode() -> None:
    environment = parallel_env()
    environment.reset(seed=1)
    good = dict.fromkeys(environment.possible_agents, GOOD)
    for _ in range(3):
        environment.step(good)
    environment.max_cycles = 2
    environment.reset()
    environment.step(good)
    environment.step(good)
    assert not environment.agents


def test_turn_based_environment_refuses_a_bad_action_at_once() -> None:
    turns = env()
    turns.reset(seed=1)
    with pytest.raises(AssertionError, match="not in action space"):
        turns.step(np.array([2.0], np.float32))
    turns.step(GOOD)
    assert turns.agent_selection == "vehicle_1"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"map": "nowhere"}, ValueError, 'no map "nowhere" ships'),
        ({"map": "nowhere.map"}, FileNotFoundError, "nowhere.map"),
        ({"vehicles": 0}, ValueError, "vehicles must be from 1 to 64, not 0"),
        ({"vehicles": 65}, ValueError, "vehicles must be from 1 to 64, not 65"),
        ({"vehicles": 12.0}, TypeError, "^vehicles is 12.0; wanted a whole number$"),
        ({"vehicles": "3"}, TypeError, "^vehicles is '3'; wanted a whole number$"),
        ({"vehicles": True}, TypeError, "^vehicles is True; wanted a whole number$"),
        ({"vehicles": 2**40}, ValueError, "^vehicles is 1099511627776; wanted at most"),
        ({"max_cycles": 2.5}, TypeError, "^max_cycles is 2.5; wanted a whole number$"),
        ({"max_cycles": None}, TypeError, "^max_cycles is None; wanted a whole number$"),
        ({"max_cycles": 0}, ValueError, "max_cycles must be from 1"),
        ({"gap": "roulette"}, ValueError, 'gap: .*no policy "roulette"'),
        ({"gap": "idm"}, ValueError, 'the policy "idm" has no gap network'),
        ({"gap": "nowhere.policy"}, FileNotFoundError, "nowhere.policy"),
        ({"render_mode": "ansi"}, ValueError, "render_mode is 'ansi'"),
    ],
)
def test_bad_argument_is_refused(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        parallel_env(**arguments)


def test_more_vehicles_than_the_map_has_room_for_are_refused(tmp_path: Path) -> None:
    short = tmp_path / "short.json"
    short.write_text(single_lane_source().replace("100.0", "30.0"))
    environment = parallel_env(short, vehicles=64)
    with pytest.raises(RuntimeError, match="64 vehicles"):
        environment.reset(seed=1)


@pytest.mark.parametrize(
    ("seed", "error"), [(-1, ValueError), (2**63, ValueError), (1.5, TypeError), ("7", TypeError), (True, TypeError)]
)
def test_bad_seed_is_refused_and_the_episode_goes_on(seed: Any, error: type[Exception]) -> None:
    environment, other = parallel_env(), parallel_env()
    for one in (environment, other):
        one.reset(seed=1)
    with pytest.raises(error, match="seed"):
        environment.reset(seed=seed)
    good = dict.fromkeys(environment.possible_agents, GOOD)
    assert as_bytes(environment.step(good)) == as_bytes(other.step(good))


def test_step_and_render_before_the_first_reset_and_step_after_the_end_are_refused() -> None:
    environment = parallel_env(vehicles=1, max_cycles=1, render_mode="rgb_array")
    good = {"vehicle_0": GOOD}
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.step(good)
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.render()
    environment.reset(seed=1)
    environment.step(good)
    with pytest.raises(ResetNeeded, match="after the world's end"):
        environment.step(good)
    environment.reset()
    environment.step(good)


def test_registering_says_nothing_and_happens_once() -> None:
    code = "import gymnasium, pettingzoo, intersection_env, importlib; import intersection_env.envs.closed_loop"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""
    assert "intersection_env/Replay-v0" in gymnasium.registry
