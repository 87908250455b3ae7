"""Both environments go alike with the same seed: again, in another process, copied, pickled, and on more threads."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from intersection_env import ClosedLoop, ClosedLoopWorlds, Replay, parallel_env
from tests.support.doors import digest, episode
from tests.support.episodes import WAYS, as_bytes
from tests.support.paths import ROOT

DIGEST = """
import sys
import intersection_env
from tests.support.doors import digest
print(digest(getattr(intersection_env, sys.argv[1])(), int(sys.argv[2])))
"""
Make = Callable[..., ClosedLoop | Replay]
BOTH = pytest.mark.parametrize("make", [parallel_env, Replay])


@BOTH
def test_same_seed_gives_the_same_episodes_to_the_last_bit_and_another_seed_others(make: Make) -> None:
    first = digest(make(), 7)
    assert digest(make(), 7) == first
    assert digest(make(), 8) != first


@BOTH
def test_same_seed_gives_the_same_episodes_in_another_process(make: Make) -> None:
    command = [sys.executable, "-W", "ignore", "-c", DIGEST, make.__name__, "7"]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert found.strip() == digest(make(), 7)


@BOTH
def test_environment_can_be_pickled_before_its_first_reset(make: Make) -> None:
    other = pickle.loads(pickle.dumps(make()))
    assert digest(other, 7) == digest(make(), 7)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("make", "gap", "options"),
    [(parallel_env, "sumo", None), (Replay, "gap", {"scene": 2})],
    ids=["parallel", "replay"],
)
def test_copy_made_within_an_episode_goes_on_alike(make: Make, gap: str, options: Any, way: str) -> None:
    environment = make(gap=gap, render_mode="rgb_array")
    environment.reset(seed=6)
    episode(environment, np.random.default_rng(1), 5)
    environment.render()
    other = WAYS[way](environment)
    if isinstance(environment, ClosedLoop):
        assert other.agents == environment.agents
    both = []
    for one in (environment, other):
        generator = np.random.default_rng(2)
        found = [episode(one, generator), one.reset(), episode(one, generator), one.reset(options=options)]
        both.append(as_bytes([*found, episode(one, generator)]))
    assert both[0] == both[1]


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


@BOTH
def test_what_was_handed_out_never_changes(make: Make) -> None:
    environment = make()
    given = [environment.reset(seed=1)]
    before = as_bytes(given)
    steps = episode(environment, np.random.default_rng(0), 3)
    kept = as_bytes(steps)
    episode(environment, np.random.default_rng(0))
    environment.reset()
    assert as_bytes(given) == before
    assert as_bytes(steps) == kept
