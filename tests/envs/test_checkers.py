"""The checks of PettingZoo and Gymnasium, and their registries."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import pettingzoo
import pettingzoo.test
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeLimit

from intersection_env import VARIANTS, ClosedLoop, Intersection, Replay, Scenes, Variant, env, parallel_env
from intersection_env.scenes.scenes import RECORDED
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


def test_environment_that_ends_together_passes_pettingzoos_checks() -> None:
    CHECKS.parallel_api_test(parallel_env(ends_together=True), num_cycles=300)
    CHECKS.api_test(env(ends_together=True), num_cycles=300)


@pytest.mark.parametrize("name", MAP_NAMES)
def test_state_passes_pettingzoos_check(name: str) -> None:
    CHECKS.state_test(env(map=name), parallel_env(map=name))


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


@pytest.mark.parametrize("kind", ["make", "make_vec"])
@pytest.mark.parametrize("load", [Scenes.load, Path])
def test_spec_names_scenes_that_were_handed_over(kind: str, load: Callable[[Path], Any]) -> None:
    scenes = load(RECORDED / "t_junction.npz")
    environment = getattr(gymnasium, kind)(ID, scenes=scenes, map=Intersection.load("t_junction"))
    text = environment.spec.to_json()
    assert json.loads(text)["kwargs"]["scenes"] == str(RECORDED / "t_junction.npz")
    assert json.loads(text)["kwargs"]["map"] == "t_junction"
    again = (
        getattr(gymnasium, kind)(EnvSpec.from_json(text)) if kind == "make" else gymnasium.make_vec(ID, scenes=scenes)
    )
    assert as_bytes(environment.reset(seed=3)) == as_bytes(again.reset(seed=3))


def test_spec_does_not_name_a_selection_by_the_file_it_is_of() -> None:
    environment = gymnasium.make(ID, scenes=Scenes.load("t_junction").select("development"), split=None)
    assert environment.spec is not None
    with pytest.raises(TypeError, match="not JSON serializable"):
        environment.spec.to_json()


@pytest.mark.parametrize("kind", ["make", "make_vec"])
def test_gymnasium_says_where_the_closed_loop_is(kind: str) -> None:
    for variant in VARIANTS:
        if variant.kind == "ClosedLoop":
            with pytest.raises(gymnasium.error.Error, match=r"PettingZoo's, pettingzoo\.make\(\"parallel\""):
                getattr(gymnasium, kind)(variant.id)


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda one: one.name)
def test_variant_is_made_with_its_arguments_and_ends_at_its_limit(variant: Variant) -> None:
    most = variant.max_episode_steps or 10
    if variant.kind == "Replay":
        limit: dict[str, Any] = {} if variant.max_episode_steps else {"max_episode_steps": most}
        replay = gymnasium.make(variant.id, **limit)
        made = Replay(**variant.arguments)
        assert as_bytes(replay.reset(seed=3)) == as_bytes(made.reset(seed=3))
        assert gymnasium.make_vec(variant.id, num_envs=2, **limit).unwrapped._limit == most  # type: ignore[attr-defined]
        check_env(gymnasium.make(variant.id).unwrapped, skip_render_check=True)
        limits = wrapped_limit(replay)
    else:
        limit = {} if variant.max_episode_steps else {"max_cycles": most}
        loop = pettingzoo.make("parallel", variant.id, **limit)
        made_loop = ClosedLoop(**variant.arguments)
        assert as_bytes(loop.reset(seed=3)) == as_bytes(made_loop.reset(seed=3))
        CHECKS.parallel_api_test(pettingzoo.make("parallel", variant.id), num_cycles=50)
        assert isinstance(loop, ClosedLoop)
        assert isinstance(pettingzoo.make("aec", variant.id).unwrapped, ClosedLoop)
        limits = loop.max_cycles
    assert limits == most


def wrapped_limit(environment: Any) -> int:
    """Of Gymnasium's wrapper around an environment."""
    while not isinstance(environment, TimeLimit):
        environment = environment.env
    return int(environment._max_episode_steps)


def test_registering_says_nothing_and_happens_once() -> None:
    code = "import gymnasium, pettingzoo, intersection_env, importlib; import intersection_env.envs.closed_loop"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""
    assert "intersection_env/Replay-v0" in gymnasium.registry
