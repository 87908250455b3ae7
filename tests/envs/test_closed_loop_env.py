"""The closed loop through PettingZoo's doors: worlds, infos, ends, spaces, and bad arguments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from intersection_env import ClosedLoopWorlds, Intersection, parallel_env
from intersection_env.features import Driving
from tests.conftest import MAP_NAMES
from tests.support.doors import ALL_STILL, GAPS, episode
from tests.support.episodes import as_bytes, gentle
from tests.support.single_lane_junction import single_lane_source


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


def test_ending_together_truncates_who_is_to_blame_too_and_changes_nothing_else() -> None:
    """RLlib's wrapper ends an episode only where all agents are terminated or all are truncated."""
    plain, together = parallel_env(), parallel_env(ends_together=True)
    generators = [np.random.default_rng(0) for _ in range(2)]
    collisions = 0
    for start in range(20):
        found = []
        for environment, generator in zip((plain, together), generators, strict=True):
            environment.reset(seed=start)
            found.append(episode(environment, generator))
        *_, (_, _, blamed, _, _) = found[1]
        for step, (one, other) in enumerate(zip(*found, strict=True), 1):
            truncations = one[3] if step < len(found[0]) else dict.fromkeys(blamed, True)
            assert as_bytes((*other[:3], other[4])) == as_bytes((*one[:3], one[4]))
            assert other[3] == truncations
        collisions += any(blamed.values())
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
                    assert info["reinserted"] == np.True_
                    assert info["reinserted"].dtype == np.bool_
                    assert observations[agent][Driving.DISTANCE_TO_STOP_LINE] > 0.0, "back before the line"
                    assert info["final_observation"][Driving.DISTANCE_TO_STOP_LINE] < 0.0, "was beyond it"
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
    assert table[:, Driving.SPEED].max() > 25.0


def test_infos_are_empty_but_after_a_reset_and_at_a_reinsertion() -> None:
    environment = parallel_env()
    observations, infos = environment.reset(seed=1)
    for agent in environment.possible_agents:
        assert infos[agent]["reinserted"].dtype == np.bool_
        assert not infos[agent]["reinserted"]
        assert (infos[agent]["final_observation"] == observations[agent]).all()
    *_, infos = environment.step(ALL_STILL)
    assert list(infos.values()) == [{}] * 12


def test_state_is_what_all_see_beside_their_bodies_until_the_end() -> None:
    environment = parallel_env(vehicles=3, max_cycles=30)
    with pytest.raises(ResetNeeded, match="no state before the first reset"):
        environment.state()
    observations, _ = environment.reset(seed=1)
    generator = np.random.default_rng(1)
    routes = environment._worlds.intersection.routes
    ends = 0
    for _ in range(200):
        state = environment.state()
        assert state.dtype == np.float32
        assert environment.state_space.contains(state)
        bodies, seen = np.split(state.reshape(3, 17), [5], axis=1)
        assert (seen == np.stack(list(observations.values()))).all()
        core = {name: values[0] for name, values in environment._worlds.state().items()}
        assert (bodies[:, 3] == core["length"]).all()
        assert (bodies[:, 4] == core["width"]).all()
        for place, route, position in zip(bodies, core["route"], core["position"], strict=True):
            assert -np.pi <= place[2] <= np.pi
            samples = routes[route].samples
            nearest = samples[int(np.argmin(np.hypot(*(samples[:, :2] - place[:2]).T)))]
            assert np.hypot(*(nearest[:2] - place[:2])) < 0.6
            front = position + 0.5 * core["length"][0]
            assert -1.0 < front < routes[route].length + 60.0
        if not environment.agents:
            ends += 1
            observations, _ = environment.reset()
        else:
            observations, *_ = environment.step(gentle(environment, generator))
    assert ends > 3


def test_seed_determines_the_generator_for_wrappers() -> None:
    environment = parallel_env(vehicles=2)
    drawn = []
    for seed in (3, 3, 4, None):
        environment.reset(seed=seed)
        drawn.append(environment.np_random.random())
    assert drawn[0] == drawn[1]
    assert len(set(drawn)) == 3
    assert environment.np_random_seed == 4


def test_end_can_be_brought_forward_within_an_episode() -> None:
    environment = parallel_env()
    environment.reset(seed=1)
    for _ in range(3):
        environment.step(ALL_STILL)
    environment.max_cycles = 2
    environment.reset()
    environment.step(ALL_STILL)
    environment.step(ALL_STILL)
    assert not environment.agents


# Bad arguments


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
