"""Both environments refuse bad actions, bad seeds and calls out of turn in words, and go on as if nothing had been."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.error import Error, InvalidAction, ResetNeeded

from intersection_env import Replay, ReplayVector, env, parallel_env
from tests.support.doors import ALL_STILL, STILL, episode
from tests.support.episodes import as_bytes

WITHOUT_FIRST = {agent: STILL for agent in ALL_STILL if agent != "vehicle_0"}
BAD: dict[str, tuple[Any, str]] = {
    "no dict": (list(ALL_STILL.values()), "must be a dict from agent to action, not list"),
    "an agent missing": (WITHOUT_FIRST, "no action for vehicle_0"),
    "an unknown agent": (ALL_STILL | {"bicycle": STILL}, "unknown agent 'bicycle'"),
    "an agent instead of another": (WITHOUT_FIRST | {"bicycle": STILL}, "no action for vehicle_0"),
    "a number": (ALL_STILL | {"vehicle_3": 0.5}, "vehicle_3: .*not float"),
    "None": (ALL_STILL | {"vehicle_3": None}, "vehicle_3: .*not NoneType"),
    "a list": (ALL_STILL | {"vehicle_3": [0.5]}, "vehicle_3: .*not list"),
    "float64": (ALL_STILL | {"vehicle_3": np.zeros(1)}, "vehicle_3: .*not float64"),
    "a scalar": (ALL_STILL | {"vehicle_3": np.array(0, np.float32)}, r"vehicle_3: .*\(1,\), not \(\)"),
    "two numbers": (ALL_STILL | {"vehicle_3": np.zeros(2, np.float32)}, r"vehicle_3: .*not \(2,\)"),
    "two axes": (ALL_STILL | {"vehicle_3": np.zeros((1, 1), np.float32)}, r"vehicle_3: .*not \(1, 1\)"),
    "two for one and none for another": (
        ALL_STILL | {"vehicle_3": np.zeros(2, np.float32), "vehicle_4": np.zeros(0, np.float32)},
        r"vehicle_3: .*not \(2,\)",
    ),
    "too large": (ALL_STILL | {"vehicle_3": np.array([1.5], np.float32)}, r"vehicle_3: .*1.5.*\[-1, 1\]"),
    "NaN": (ALL_STILL | {"vehicle_3": np.array([np.nan], np.float32)}, "vehicle_3: .*nan"),
    "infinite": (ALL_STILL | {"vehicle_0": np.array([-np.inf], np.float32)}, "vehicle_0: .*-inf"),
}
BAD_IN_REPLAY: dict[str, tuple[Any, str]] = {
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
QUARTER: Any = torch.full((1,), 0.25)
Make = Callable[..., Any]


@pytest.mark.parametrize(
    ("make", "good", "bad", "message"),
    [
        *(pytest.param(parallel_env, ALL_STILL, *case, id=f"parallel-{name}") for name, case in BAD.items()),
        *(pytest.param(Replay, STILL, *case, id=f"replay-{name}") for name, case in BAD_IN_REPLAY.items()),
    ],
)
def test_bad_action_is_refused_and_the_episode_goes_on(make: Make, good: Any, bad: Any, message: str) -> None:
    environment, other = make(), make()
    for one in (environment, other):
        one.reset(seed=1)
        one.step(good)
    with pytest.raises(InvalidAction, match=message):
        environment.step(bad)
    assert as_bytes(environment.step(good)) == as_bytes(other.step(good))


@pytest.mark.parametrize(
    ("make", "good", "tensors"),
    [
        (parallel_env, dict.fromkeys(ALL_STILL, np.full(1, 0.25, np.float32)), dict.fromkeys(ALL_STILL, QUARTER)),
        (Replay, np.full(1, 0.25, np.float32), QUARTER),
    ],
    ids=["parallel", "replay"],
)
def test_action_of_another_library_is_read(make: Make, good: Any, tensors: Any) -> None:
    environment, other = make(), make()
    for one in (environment, other):
        one.reset(seed=1)
    assert as_bytes(environment.step(tensors)) == as_bytes(other.step(good))


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (torch.zeros(1, dtype=torch.float64), "float64"),
        ([np.float32(0.25)], "list"),
        (torch.zeros(1, requires_grad=True), "Tensor"),
    ],
)
def test_action_of_another_library_that_is_no_array_of_float32_is_refused(bad: Any, message: str) -> None:
    environment, replay = parallel_env(), Replay()
    environment.reset(seed=1)
    replay.reset(seed=1)
    with pytest.raises(InvalidAction, match=f"vehicle_3: .*not {message}"):
        environment.step(ALL_STILL | {"vehicle_3": bad})
    with pytest.raises(InvalidAction, match=f"float32, not {message}"):
        replay.step(bad)


@pytest.mark.parametrize(
    ("make", "good", "seed", "error"),
    [
        (parallel_env, ALL_STILL, -1, ValueError),
        (parallel_env, ALL_STILL, 2**63, ValueError),
        (parallel_env, ALL_STILL, 1.5, TypeError),
        (parallel_env, ALL_STILL, "7", TypeError),
        (parallel_env, ALL_STILL, True, TypeError),
        (Replay, STILL, -1, Error),
        (Replay, STILL, 2**63, ValueError),
        (Replay, STILL, 1.5, Error),
        (Replay, STILL, "7", Error),
        (Replay, STILL, True, TypeError),
    ],
)
def test_bad_seed_is_refused_and_the_episode_goes_on(make: Make, good: Any, seed: Any, error: type[Exception]) -> None:
    environment, other = make(), make()
    for one in (environment, other):
        one.reset(seed=1)
    with pytest.raises(error, match="Seed" if error is Error else "seed"):  # Gymnasium's own, and ours
        environment.reset(seed=seed)
    assert as_bytes(environment.step(good)) == as_bytes(other.step(good))


@pytest.mark.parametrize(
    ("make", "good", "after"),
    [
        (partial(parallel_env, vehicles=1, max_cycles=1), {"vehicle_0": STILL}, "after the world's end"),
        (Replay, STILL, "after an episode's end"),
    ],
    ids=["parallel", "replay"],
)
def test_step_and_render_before_the_first_reset_and_step_after_the_end_are_refused(
    make: Make, good: Any, after: str
) -> None:
    environment = make(render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.step(good)
    with pytest.raises(ResetNeeded, match="before the first reset"):
        environment.render()
    environment.reset(seed=1)
    episode(environment, np.random.default_rng(0))
    with pytest.raises(ResetNeeded, match=after):
        environment.step(good)
    environment.reset()
    environment.step(good)


def test_vector_refuses_a_step_before_the_first_reset_and_a_first_reset_of_some_worlds() -> None:
    envs = ReplayVector(2)
    with pytest.raises(ResetNeeded, match="before the first reset"):
        envs.step(np.zeros((2, 1), np.float32))
    with pytest.raises(ResetNeeded, match="must start all worlds"):
        envs.reset(options={"reset_mask": np.array([True, False])})


def test_turn_based_environment_refuses_a_bad_action_at_once() -> None:
    turns = env()
    turns.reset(seed=1)
    with pytest.raises(AssertionError, match="not in action space"):
        turns.step(np.array([2.0], np.float32))
    turns.step(STILL)
    assert turns.agent_selection == "vehicle_1"
