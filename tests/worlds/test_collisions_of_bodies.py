"""Collisions by the rectangles that vehicles are, an option beside the paper's two circles: core, twin and doors."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import intersection_env
from intersection_env import ClosedLoop, ClosedLoopWorlds, Replay, ReplayVector, ReplayWorlds, _core
from tests.conftest import MAP_NAMES
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Rules
from tests.support.twins import CASES, as_traffic, twin_map
from tests.support.world_traces import outputs
from tests.support.worlds_cases import (
    FLAGS,
    OUTPUTS,
    Placed,
    agrees,
    closed_loop,
    core_of,
    is_on_a_knife_edge,
    random_state,
    rewards,
    twin_of,
)

BODIES = ("circles", "rectangles")


@pytest.mark.parametrize(("bodies", "collides"), [("circles", False), ("rectangles", True)])
def test_a_car_in_the_side_of_a_bus_collides_by_rectangles_alone(bodies: str, collides: bool) -> None:
    """S-W stands across W-E, whose circles lie 4.5 m before and behind the middle of its bus."""
    bus = Placed("W-E", 158.25, 0.0, length=18.0)
    assert bool(rewards("t_junction", bus, Placed("S-W", 102.0, 0.0), bodies=bodies)["done"]) == collides


@pytest.mark.parametrize(("bodies", "collides"), [("circles", False), ("rectangles", True)])
def test_a_truck_ends_where_it_ends_by_rectangles_alone(bodies: str, collides: bool) -> None:
    """The circles of a truck of 12 m and a car end 2 m before the truck's rear: 0.3 m of air are not enough."""
    truck = Placed("W-E", 50.0, 0.0, length=12.0)
    assert bool(rewards("t_junction", Placed("W-E", 41.7, 0.0), truck, bodies=bodies)["done"]) == collides


@pytest.mark.parametrize("name", MAP_NAMES)
def test_one_step_of_the_core_equals_the_twin_by_rectangles(name: str) -> None:
    generator, rules, intersection = np.random.default_rng(9), Rules(), twin_map(name)
    states = [random_state(name, generator, 8, rules) for _ in range(90 * CASES)]
    actions = np.array([generator.uniform(-1, 1, 8) * generator.choice([0.05, 0.5]) for _ in states], np.float32)
    loops: dict[str, _core.ClosedLoop] = {}
    for bodies in BODIES:
        loop = loops[bodies] = closed_loop(name, len(states), 8, bodies=bodies)
        loop.reset(1, False)
        loop.set_state(core_of(states))
        loop.action[:] = actions
        loop.step()
    seen, after = outputs(loops["rectangles"]), loops["rectangles"].state()
    excused = 0
    for world, state in enumerate(states):
        action, moved = actions[world].astype(np.float64), twin_of(after, world)
        truth = reference_worlds.step(intersection, state, action, rules, moved.traffic, bodies="rectangles")
        wrong = agrees({key: seen[key][world] for key in OUTPUTS}, moved, truth)
        if wrong and not is_on_a_knife_edge(name, state, action, rules, moved.traffic, False, "rectangles"):
            pytest.fail(f"world {world}: {wrong} differ; {state}, {action}")
        excused += bool(wrong)
    assert excused <= 0.02 * len(states)
    circles, rectangles = (loops[bodies].done for bodies in BODIES)
    assert (rectangles & ~circles).any(), "nothing here tells rectangles from circles"
    assert not rectangles.all()


@pytest.mark.parametrize("name", MAP_NAMES)
def test_starts_violate_no_constraint_by_rectangles(name: str) -> None:
    worlds = 12 * CASES
    loop = closed_loop(name, worlds, 12, bodies="rectangles")
    loop.reset(7, False)
    for world in range(worlds):
        state = twin_of(loop.state(), world)
        assert reference_worlds.violations(twin_map(name), state, "rectangles") == [], f"world {world}"
        traffic = as_traffic(intersection_env.Intersection.load(name), state.traffic)
        assert _core.collision(traffic.intersection.core, traffic.core, "rectangles") is None


def collided(worlds: ClosedLoopWorlds) -> tuple[np.ndarray[Any, Any], ...]:
    """What happens to drivers who all go straight on at first, then by chance."""
    worlds.reset(3)
    generator, found = np.random.default_rng(0), []
    for _ in range(80):
        worlds.action[:] = generator.uniform(-0.3, 0.3, worlds.action.shape)
        worlds.step()
        found += [getattr(worlds, name).copy() for name in (*FLAGS, "reward")]
    return tuple(found)


def test_worlds_by_rectangles_stay_so_when_pickled() -> None:
    circles, rectangles = (ClosedLoopWorlds(worlds=8, bodies=bodies) for bodies in ("circles", "rectangles"))
    expected = collided(rectangles)
    assert any((one != other).any() for one, other in zip(expected, collided(circles), strict=True))
    again = collided(pickle.loads(pickle.dumps(rectangles)))
    for one, other in zip(expected, again, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_environment_is_a_view_of_such_worlds_to_its_new_end_too() -> None:
    """A world at a time: the first end by rectangles, also once `max_cycles` was changed."""
    for change in (False, True):
        env, ends = ClosedLoop(bodies="rectangles"), []
        if change:
            env.max_cycles = 1500
        worlds = ClosedLoopWorlds(bodies="rectangles", autoreset="off")
        for seed in range(12):
            env.reset(seed=seed)
            worlds.reset(seed)
            while env.agents:
                env.step({agent: np.zeros(1, np.float32) for agent in env.agents})
                worlds.action[:] = 0.0
                worlds.step()
            assert worlds.done[0]
            ends.append(worlds.terminated.any())
        assert any(ends)


DOORS: dict[str, Callable[..., Any]] = {
    "ClosedLoop": ClosedLoop,
    "ClosedLoopWorlds": ClosedLoopWorlds,
    "Replay": Replay,
    "ReplayVector": ReplayVector,
    "ReplayWorlds": ReplayWorlds,
    "make": lambda **given: gymnasium.make("intersection_env/Replay-v0", **given).unwrapped,
}


@pytest.mark.parametrize("door", DOORS)
def test_every_door_takes_rectangles_and_refuses_what_is_no_body(door: str) -> None:
    made = DOORS[door](bodies="rectangles")
    worlds = made if isinstance(made, ClosedLoopWorlds | ReplayWorlds) else made._worlds
    assert worlds._arguments["bodies"] == "rectangles"
    with pytest.raises(ValueError, match=r'^bodies is "boxes"; wanted circles or rectangles'):
        DOORS[door](bodies="boxes")
