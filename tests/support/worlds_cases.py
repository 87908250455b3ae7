"""Worlds for the core and for its twin, and the rule by which a disagreement may be a matter of rounding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import Intersection, _core
from intersection_env.policies.file import PolicyFile
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Rules, State
from tests.support.core_and_twin import weights
from tests.support.random_traffic import random_traffic
from tests.support.twins import random_networks, twin_map

Arrays = dict[str, NDArray[Any]]
FLOATS = ("position", "speed", "length", "width", "max_speed")
OUTPUTS = ("observation", "final_observation", "reward", "terminated", "truncated", "reinserted", "done")
FLAGS = ("terminated", "truncated", "reinserted")
LONG = 1_000_000  # cycles: nobody gets there

ROUNDING = 1e-4
"""[m], [m/s]: three times what float32 loses in one step at 300 m along a route."""
NUDGES = 24
"""Random patterns of signs; a threshold hangs on four numbers or so, so one of 16 patterns moves it furthest."""
OBSERVATION_TOLERANCE = 1e-3
REWARD_TOLERANCE = 0.02
"""v_min's slope is infinite where d = 0: 20 / (5 m/s) · sqrt(2 · 1e-5 m), for a bicycle."""


def rules_and_policy(gap: str, seed: int = 0) -> tuple[Rules, _core.Policy]:
    """The same gap decisions for the twin and for the core: a rule, or a random network."""
    if gap != "network":
        return Rules(gap), _core.Policy(PolicyFile(gap, "idm").text(), "test")  # type: ignore[arg-type]
    network, _ = random_networks(np.random.default_rng(seed))
    rounded = reference.Network(
        network.shift.astype(np.float32).astype(np.float64),
        network.scale.astype(np.float32).astype(np.float64),
        tuple(
            (w.astype(np.float32).astype(np.float64), b.astype(np.float32).astype(np.float64))
            for w, b in network.layers
        ),
    )
    return Rules("network", rounded), _core.Policy(PolicyFile("network", "idm", weights(network)).text(), "test")


def closed_loop(
    name: str,
    worlds: int,
    vehicles: int,
    *,
    gap: str = "critical_gap",
    max_cycles: int = LONG,
    autoreset: str = "off",
    threads: int = 1,
    isa: str | None = None,
    bodies: str = "circles",
) -> _core.ClosedLoop:
    """Worlds on a shipped map."""
    _, policy = rules_and_policy(gap)
    core = Intersection.load(name).core
    return _core.ClosedLoop(core, policy, worlds, vehicles, max_cycles, autoreset, threads, isa, bodies)


def core_of(states: Sequence[State], cycle: int = 0) -> Arrays:
    """The twins' worlds as `set_state` takes them."""
    worlds = len(states)

    def stacked(rows: Sequence[NDArray[Any]], dtype: type) -> NDArray[Any]:
        return np.ascontiguousarray(np.stack(rows), dtype=dtype)

    return {
        "route": stacked([state.traffic.route for state in states], np.int32),
        **{name: stacked([getattr(state.traffic, name) for state in states], np.float32) for name in FLOATS},
        "acceleration": stacked([np.zeros(len(state.delta)) for state in states], np.float32),
        "delta": stacked([state.delta for state in states], np.bool_),
        "hold": stacked([state.hold for state in states], np.int32),
        "waited": stacked([state.waited for state in states], np.int32),
        "cycle": np.full(worlds, cycle, np.int32),
        "done": np.zeros(worlds, np.bool_),
        "random": np.arange(1, 8 * worlds + 1, dtype=np.uint32).reshape(worlds, 8),
    }


def twin_of(state: Arrays, world: int) -> State:
    """One of the core's worlds, as the twin has it."""
    return State(
        reference.Traffic(
            state["route"][world].astype(np.int64), *(state[name][world].astype(np.float64) for name in FLOATS)
        ),
        state["delta"][world].astype(np.bool_),
        state["hold"][world].astype(np.int64),
        state["waited"][world].astype(np.int64),
    )


@dataclass(frozen=True)
class Placed:
    """A vehicle at the moment that is judged, and the acceleration of the step that leads there."""

    route: str
    position: float
    speed: float
    acceleration: float = 0.0
    length: float = 4.0
    width: float = 2.0
    max_speed: float = np.inf
    delta: bool = False
    """What it remembers to have decided one step before."""


def rewards(name: str, *vehicles: Placed, gap: str = "critical_gap", bodies: str = "circles") -> Arrays:
    """The core's outputs for one world whose step ends with the vehicles so placed; each (vehicle, ...)."""
    intersection = Intersection.load(name)
    speed = np.array([one.speed - reference.TIME_STEP * one.acceleration for one in vehicles])
    travelled = np.array([reference.TIME_STEP * (s + one.speed) / 2 for s, one in zip(speed, vehicles, strict=True)])
    traffic = reference.Traffic(
        np.array([intersection.route_index(one.route) for one in vehicles], np.int64),
        np.array([one.position for one in vehicles]) - travelled,
        speed,
        *(np.array([getattr(one, field) for one in vehicles]) for field in ("length", "width", "max_speed")),
    )
    delta = np.array([one.delta for one in vehicles])
    loop = closed_loop(name, 1, len(vehicles), gap=gap, bodies=bodies)
    loop.reset(0, False)
    loop.set_state(core_of([State(traffic, delta, np.full(len(vehicles), -1))]))
    loop.action[:] = np.array([[one.acceleration / 6 for one in vehicles]], np.float32)
    loop.step()
    return {name: getattr(loop, name)[0].copy() for name in OUTPUTS} | {
        name: loop.state()[name][0] for name in ("position", "speed", "delta", "hold")
    }


def random_state(name: str, generator: np.random.Generator, vehicles: int, rules: Rules) -> State:
    """Plausible traffic, one in eight slightly backwards, some about to leave; memories decided or arbitrary."""
    intersection = twin_map(name)
    traffic = random_traffic(intersection, generator, vehicles)
    backwards = generator.random(vehicles) < 0.125
    speed = np.where(backwards, generator.uniform(-0.8, 0.0, vehicles), traffic.speed)
    length = np.array([intersection.routes[route].length for route in traffic.route])
    edge = np.where(backwards, generator.uniform(0.0, 0.2, vehicles), length - generator.uniform(0.1, 4.0, vehicles))
    position = np.where(generator.random(vehicles) < 0.06, edge, traffic.position)
    traffic = replace(
        traffic,
        position=position.astype(np.float32).astype(np.float64),
        speed=speed.astype(np.float32).astype(np.float64),
    )
    if generator.random() < 0.5:
        hold = generator.integers(-1, len(intersection.routes), vehicles)
        stops = np.array([intersection.routes[route].must_stop for route in traffic.route])
        waited = generator.integers(0, 3, vehicles) * stops
        return State(traffic, generator.random(vehicles) < 0.5, hold, waited)
    memory = reference.initial_memory(intersection, traffic)
    return reference_worlds.decided(intersection, traffic, memory.delta, memory.hold, rules)[0]


def agrees(seen: Arrays, after: State, truth: reference_worlds.Step) -> str:
    """What the core's world does not share with its twin's; empty if nothing. seen: `OUTPUTS`, (vehicle, ...)."""
    wrong = [name for name in FLAGS if (seen[name] != getattr(truth, name)).any()]
    wrong += ["done"] if bool(seen["done"]) != truth.done else []
    wrong += ["delta"] if (after.delta != truth.state.delta).any() else []
    wrong += ["hold"] if (after.hold != truth.state.hold).any() else []
    wrong += ["waited"] if (after.waited != truth.state.waited).any() else []
    flagged = truth.terminated | truth.truncated | truth.reinserted
    pairs = [
        ("observation", seen["observation"], truth.observation, OBSERVATION_TOLERANCE),
        (
            "final_observation",
            seen["final_observation"][flagged],
            truth.final_observation[flagged],
            OBSERVATION_TOLERANCE,
        ),
        ("reward", seen["reward"], truth.reward, REWARD_TOLERANCE),
        ("position", after.traffic.position, truth.state.traffic.position, OBSERVATION_TOLERANCE),
        ("speed", after.traffic.speed, truth.state.traffic.speed, OBSERVATION_TOLERANCE),
    ]
    wrong += [word for word, one, other, most in pairs if not np.allclose(one, other, atol=most, rtol=1e-5)]
    return ", ".join(wrong)


def is_on_a_knife_edge(
    name: str,
    state: State,
    action: NDArray[np.float64],
    rules: Rules,
    newcomers: reference.Traffic,
    is_last: bool,
    bodies: str = "circles",
) -> bool:
    """Whether the twin itself tells another story when its start is moved by what float32 may lose.

    The margin rule: positions and speeds move by ±1e-4, accelerations by ±1e-6 m/s², each vehicle's signs at random.
    """
    intersection = twin_map(name)
    truth = reference_worlds.step(intersection, state, action, rules, newcomers, is_last, bodies)
    generator = np.random.default_rng(0)
    for _ in range(NUDGES):
        position, speed, push = generator.choice([-1.0, 1.0], (3, len(action)))
        traffic = replace(
            state.traffic,
            position=state.traffic.position + ROUNDING * position,
            speed=state.traffic.speed + ROUNDING * speed,
        )
        nudged = reference_worlds.step(
            intersection, replace(state, traffic=traffic), action + push * 1e-6 / 6, rules, newcomers, is_last, bodies
        )
        same = all((getattr(nudged, flag) == getattr(truth, flag)).all() for flag in FLAGS)
        same = same and nudged.done == truth.done
        same = same and bool((nudged.state.delta == truth.state.delta).all())
        same = same and bool((nudged.state.hold == truth.state.hold).all())
        same = same and bool((nudged.state.waited == truth.state.waited).all())
        near = np.allclose(nudged.observation, truth.observation, atol=0.01)
        if not (same and near and np.allclose(nudged.reward, truth.reward, atol=0.2)):
            return True
    return False
