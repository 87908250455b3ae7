"""Rewards and observations of one's own, as the manual has them: wrappers that the checkers accept."""

from __future__ import annotations

import re
from typing import Any

import gymnasium
import numpy as np
import pettingzoo.test
import pytest
from gymnasium.utils.env_checker import check_env

from experiments.documentation.environments import PAGE
from intersection_env import Replay, parallel_env
from intersection_env.features import Driving

CHECKS: Any = pettingzoo.test  # without annotations


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    """What the page's code defines."""
    section = PAGE.read_text().split("## A reward or an observation of your own\n")[1]
    code = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert code is not None
    namespace: dict[str, Any] = {}
    exec(compile(code[1], PAGE.name, "exec"), namespace)
    return namespace


def test_own_reward_passes_gymnasiums_check_and_charges_for_jerks(page: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match="is different from the unwrapped version"):  # which is the wrapper's purpose
        check_env(page["Smooth"](Replay()), skip_render_check=True)
    smooth, plain = (
        page["Smooth"](gymnasium.make("intersection_env/Replay-v0")),
        gymnasium.make("intersection_env/Replay-v0"),
    )
    for one in (smooth, plain):
        one.reset(seed=4)
    last = 0.0
    for value in (0.1, 0.1, -0.2):
        action = np.array([value], np.float32)
        (_, paid, *_), (_, without, *_) = smooth.step(action), plain.step(action)
        assert float(without) - paid == pytest.approx(0.01 * abs(value - last) * 6.0 / 0.2, abs=1e-4)
        last = value


def test_own_observation_passes_pettingzoos_check_and_is_part_of_the_whole(page: dict[str, Any]) -> None:
    CHECKS.parallel_api_test(page["Nearby"](parallel_env()), num_cycles=200)
    nearby, plain = page["Nearby"](parallel_env()), parallel_env()
    actions = {agent: np.full(1, 0.1, np.float32) for agent in plain.possible_agents}
    nearby.reset(seed=1)
    plain.reset(seed=1)
    (part, rewards, *_), (whole, _, terminations, *_) = nearby.step(actions), plain.step(actions)
    for agent, row in whole.items():
        assert (part[agent] == row[nearby.seen]).all()
        assert nearby.observation_space(agent).contains(part[agent])
        wanted = row[Driving.SPEED] / row[Driving.V_MAX] - 1000.0 * terminations[agent]
        assert rewards[agent] == pytest.approx(float(wanted))
