"""Starts of the closed loop, and newcomers in the place of vehicles that left: lawful, random, and refused in words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Predictor, Traffic, _core
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from tests.conftest import MAP_NAMES
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Rules
from tests.support.core_and_twin import weights
from tests.support.twins import CASES, as_traffic, random_networks, twin_map
from tests.support.world_traces import act
from tests.support.worlds_cases import LONG, OUTPUTS, closed_loop, rules_and_policy, twin_of


@pytest.mark.parametrize("name", MAP_NAMES)
@pytest.mark.parametrize("vehicles", [1, 12, 24])
@pytest.mark.parametrize("gap", ["critical_gap", "sumo"])
def test_starts_violate_no_constraint(name: str, vehicles: int, gap: str) -> None:
    worlds = 12 * CASES if vehicles > 1 else 100
    loop, intersection = closed_loop(name, worlds, vehicles, gap=gap), twin_map(name)
    loop.reset(7, False)
    state = loop.state()
    assert not state["done"].any()
    assert (state["cycle"] == 0).all()
    rules = rules_and_policy(gap)[0]
    waits = 0
    for world in range(worlds):
        twin = twin_of(state, world)
        assert reference_worlds.violations(intersection, twin) == [], f"world {world}"
        seen = reference_worlds.decided(intersection, twin.traffic, twin.delta, twin.hold, rules)[1].driving
        seen[:, Driving.ENTERS] = twin.delta
        np.testing.assert_allclose(loop.observation[world], seen, atol=1e-3)
        waits += int((~twin.delta).sum())
    assert vehicles == 1 or waits > worlds / 2  # of whom the stop line asks something


@pytest.mark.parametrize("name", MAP_NAMES)
def test_starts_are_decided_as_the_model_says(name: str) -> None:
    """From the memories that a vehicle has at a start."""
    rules, intersection, different = Rules(), twin_map(name), 0
    loop = closed_loop(name, 60, 12)
    loop.reset(8, False)
    for world in range(60):
        state = twin_of(loop.state(), world)
        memory = reference.initial_memory(intersection, state.traffic)
        truth, _ = reference_worlds.decided(intersection, state.traffic, memory.delta, memory.hold, rules)
        different += bool((truth.delta != state.delta).any() or (truth.hold != state.hold).any())
    assert different <= 1  # on a knife edge


@pytest.mark.parametrize("name", MAP_NAMES)
def test_starts_use_all_routes_sizes_and_the_whole_road(name: str) -> None:
    loop = closed_loop(name, 300, 8)
    loop.reset(9, False)
    state = loop.state()
    routes = Intersection.load(name).routes
    count = np.bincount(state["route"].ravel(), minlength=len(routes))
    assert (count > 0.5 * state["route"].size / len(routes)).all()
    check_sizes(state["length"].ravel(), state["width"].ravel())
    share = state["position"] / np.array([route.length for route in routes], np.float32)[state["route"]]
    assert (np.histogram(share, 10, (0, 1))[0] > 0.04 * share.size).all()
    assert np.isinf(state["max_speed"]).all()


def check_sizes(length: NDArray[Any], width: NDArray[Any]) -> None:
    """Nine in ten are cars; all lie in their ranges, and fill them."""
    cars = length < 5.5
    assert 0.86 < cars.mean() < 0.94
    for chosen, low, high, narrow, wide in ((cars, 3.8, 5.2, 1.7, 2.0), (~cars, 6.5, 12.0, 2.3, 2.55)):
        for values, begin, end in ((length[chosen], low, high), (width[chosen], narrow, wide)):
            assert values.min() >= begin - 1e-5
            assert values.max() <= end + 1e-5
            assert abs(values.mean() - (begin + end) / 2) < 0.1 * (end - begin)


def test_traffic_of_a_start_is_traffic() -> None:
    """What a world holds can be predicted from, as any other moment."""
    loop = closed_loop("bendplatz", 8, 12, max_cycles=LONG)
    loop.reset(30, False)
    for world in range(8):
        traffic = as_traffic(Intersection.load("bendplatz"), twin_of(loop.state(), world).traffic)
        assert isinstance(traffic, Traffic)
        assert Predictor.load("idm").predict(traffic).minimum_distance[0] > -5


def test_desynchronised_worlds_begin_at_cycles_of_their_own() -> None:
    loop = closed_loop("t_junction", 64, 2, max_cycles=1000)
    loop.reset(0, True)
    cycle = loop.state()["cycle"]
    assert len(np.unique(cycle)) > 50
    assert cycle.min() >= 0
    assert cycle.max() < 1000
    loop.reset(0, False)
    assert (loop.state()["cycle"] == 0).all()


def test_reset_of_some_worlds_leaves_the_others() -> None:
    loop = closed_loop("bendplatz", 20, 5)
    loop.reset(3, False)
    act(loop, np.random.default_rng(0), 0.1)
    before = loop.state()
    mask = np.zeros(20, np.bool_)
    mask[[2, 17]] = True
    loop.reset_worlds(mask)
    after = loop.state()
    for name, values in after.items():
        np.testing.assert_array_equal(values[~mask], before[name][~mask], err_msg=name)
    assert (after["position"][mask] != before["position"][mask]).any(axis=1).all()
    assert (after["cycle"][mask] == 0).all()
    for world in np.flatnonzero(mask).tolist():
        assert reference_worlds.violations(twin_map("bendplatz"), twin_of(after, world)) == []
    loop.reset_worlds(mask)
    assert (loop.state()["position"][mask] != after["position"][mask]).any(axis=1).all()


def test_impossible_worlds_are_refused() -> None:
    with pytest.raises(ValueError, match="vehicles"):
        closed_loop("t_junction", 1, 0)
    with pytest.raises(ValueError, match="vehicles"):
        closed_loop("t_junction", 1, 65)
    with pytest.raises(ValueError, match="worlds"):
        closed_loop("t_junction", 0, 4)
    with pytest.raises(ValueError, match="autoreset"):
        closed_loop("t_junction", 1, 4, autoreset="sometimes")
    with pytest.raises(ValueError, match=r"isa|instruction set|kernel"):
        closed_loop("t_junction", 1, 4, isa="v9")


def test_actions_of_another_kind_are_refused() -> None:
    loop = closed_loop("t_junction", 2, 3)
    with pytest.raises((TypeError, AttributeError)):
        loop.action = np.zeros((2, 3))  # type: ignore[misc, assignment]
    assert loop.action.dtype == np.float32
    for name in OUTPUTS:
        assert getattr(loop, name).shape[: 1 if name == "done" else 2] == ((2,) if name == "done" else (2, 3))


# Newcomers


def test_vehicles_that_leave_come_back_as_the_model_says() -> None:
    """Each at 0 m on a random route, of a random size, with a speed that suits the road ahead."""
    loop = closed_loop("bendplatz", 400, 3)
    loop.reset(2, False)
    state = loop.state()
    lengths = np.array([route.length for route in Intersection.load("bendplatz").routes], np.float32)
    state["position"][:, 0] = lengths[state["route"][:, 0]] - 0.5
    state["speed"][:, 0] = 8.0
    state["delta"][:, 0] = True
    for other, position in ((1, 30.0), (2, 60.0)):  # near enough to the begin to be somebody's lead
        state["position"][:, other] = position
        state["speed"][:, other] = 8.0
    loop.set_state(state)
    loop.action[:] = 0
    loop.step()
    after = loop.state()
    came = loop.reinserted[:, 0]
    assert came.mean() > 0.9
    assert not loop.reinserted[:, 1:].any()
    new = {name: values[came, 0] for name, values in after.items() if values.ndim == 2 and name != "random"}
    assert (new["position"] == 0).all()
    assert (new["acceleration"] == 0).all() or np.isfinite(new["acceleration"]).all()
    assert (np.bincount(new["route"], minlength=12) > 12).all()
    check_sizes(new["length"], new["width"])
    places, intersection = [], twin_map("bendplatz")
    left = np.array([True, False, False])
    for world in np.flatnonzero(came).tolist():
        twin = twin_of(after, world)
        distance = reference_worlds.newcomer_distance(intersection, twin.traffic, left, 0)
        low, high = reference_worlds.speed_range(intersection, twin.traffic, 0, distance)
        assert low - 1e-3 <= twin.traffic.speed[0] <= high + 1e-3
        places += [(twin.traffic.speed[0] - low) / (high - low)] if high > low + 0.5 else []
    assert len(places) > 30
    assert 0.4 < np.mean(places) < 0.6
    assert loop.final_observation[came, 0, Driving.LEAD_DISTANCE] == pytest.approx(100.0)
    assert (loop.final_observation[came, 0, Driving.ENTERS] == 1).all()
    assert not (loop.final_observation[came, 0] == loop.observation[came, 0]).all(axis=1).any()


def test_newcomer_forgets_what_the_one_before_it_remembered() -> None:
    """One that had been held would let a yielder enter whatever its gap; this yielder never would by itself."""
    network, _ = random_networks(np.random.default_rng(0))
    never = PolicyFile("network", "idm", replace(weights(network), layers=refusing(weights(network).layers)))
    core = Intersection.load("t_junction")
    loop = _core.ClosedLoop(core.core, _core.Policy(never.text(), "test"), 200, 2, LONG, "off", 1)
    loop.reset(0, False)
    state = loop.state()
    state["route"][:] = [0, core.route_index("S-W")]
    state["position"][:] = [319.9, 60.0]
    state["speed"][:] = [10.0, 5.0]
    state["hold"][:] = [len(core.routes), -1]
    state["delta"][:] = [True, False]
    loop.set_state(state)
    loop.action[:] = 0
    loop.step()
    after = loop.state()
    priority = np.isin(after["route"][:, 0], [core.route_index(route) for route in ("W-E", "E-W", "E-S")])
    assert 0.35 < priority.mean() < 0.65
    assert loop.reinserted[:, 0].all()
    assert not after["delta"][priority, 1].any()
    assert (after["hold"][priority, 0] == -1).all()


def refusing(layers: Any) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """The layers, the last of which always answers -1."""
    *first, (weight, bias) = layers
    return [*first, (0 * weight, 0 * bias - 1)]


def test_second_newcomer_sees_the_first() -> None:
    """Two that leave at once may come to one lane: they collide there, and the world ends."""
    loop = closed_loop("t_junction", 600, 2)
    loop.reset(4, False)
    state = loop.state()
    state["route"][:] = [0, 2]
    state["position"][:] = 319.9
    state["speed"][:] = 10.0
    loop.set_state(state)
    loop.action[:] = 0
    loop.step()
    after, intersection = loop.state(), twin_map("t_junction")
    stop_lane = np.array([route.stop_lane for route in intersection.routes])[after["route"]]
    same = stop_lane[:, 0] == stop_lane[:, 1]
    assert 0.2 < same.mean() < 0.47
    assert loop.done[same].all()  # both at 0 m
    assert not loop.done[~same].any()
    assert loop.reinserted[~same].all()
    assert loop.truncated[same].all()
    assert not loop.reinserted[same].any()


def test_a_world_that_a_newcomer_would_enter_badly_ends() -> None:
    """Both lanes' begins are full: who comes stands in somebody."""
    loop = closed_loop("t_junction", 30, 4)
    loop.reset(6, False)
    state = loop.state()
    state["route"][:] = [0, 2, 4, 0]
    state["position"][:] = [3.0, 3.0, 3.0, 319.9]
    state["speed"][:] = [0.0, 0.0, 0.0, 10.0]
    for name, value in (("length", 4.0), ("width", 2.0)):
        state[name][:] = value
    loop.set_state(state)
    loop.action[:] = 0
    loop.step()
    assert loop.done.all()
    assert not loop.reinserted.any()
    assert (loop.terminated | loop.truncated).all()
    assert loop.truncated[:, 3].all()
    assert loop.reward[:, 3].min() > -20
