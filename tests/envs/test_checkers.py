"""The checks of PettingZoo and Gymnasium, and their registries."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import gymnasium
import pettingzoo
import pettingzoo.test
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from intersection_env import ClosedLoop, env, parallel_env
from tests.conftest import MAP_NAMES
from tests.support.doors import GAPS, REPLAY_GAPS
from tests.support.episodes import as_bytes

CHECKS: Any = pettingzoo.test  # without annotations
ID = "intersection_env/Replay-v0"


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


@pytest.mark.parametrize("gap", REPLAY_GAPS)
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


def test_registering_says_nothing_and_happens_once() -> None:
    code = "import gymnasium, pettingzoo, intersection_env, importlib; import intersection_env.envs.closed_loop"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""
    assert "intersection_env/Replay-v0" in gymnasium.registry
