"""Worlds for the core and for its twin, and the rule by which a disagreement may be a matter of rounding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intersection_env import Intersection, _core
from intersection_env.constants import BICYCLE_MAX_SPEED
from intersection_env.policies.file import PolicyFile
from intersection_env.scenes.scene import Scene
from tests.core.test_core import weights
from tests.reference import predictor as reference
from tests.reference import worlds as reference_worlds
from tests.reference.worlds import Rules, State
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
) -> _core.ClosedLoop:
    """Worlds on a shipped map."""
    _, policy = rules_and_policy(gap)
    return _core.ClosedLoop(Intersection.load(name).core, policy, worlds, vehicles, max_cycles, autoreset, threads, isa)


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


def rewards(name: str, *vehicles: Placed, gap: str = "critical_gap") -> Arrays:
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
    loop = closed_loop(name, 1, len(vehicles), gap=gap)
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
    traffic = reference.random_traffic(intersection, generator, vehicles)
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
        return State(traffic, generator.random(vehicles) < 0.5, hold)
    memory = reference.initial_memory(intersection, traffic)
    return reference_worlds.decided(intersection, traffic, memory.delta, memory.hold, rules)[0]


def agrees(seen: Arrays, after: State, truth: reference_worlds.Step) -> str:
    """What the core's world does not share with its twin's; empty if nothing. seen: `OUTPUTS`, (vehicle, ...)."""
    wrong = [name for name in FLAGS if (seen[name] != getattr(truth, name)).any()]
    wrong += ["done"] if bool(seen["done"]) != truth.done else []
    wrong += ["delta"] if (after.delta != truth.state.delta).any() else []
    wrong += ["hold"] if (after.hold != truth.state.hold).any() else []
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
    name: str, state: State, action: NDArray[np.float64], rules: Rules, newcomers: reference.Traffic, is_last: bool
) -> bool:
    """Whether the twin itself tells another story when its start is moved by what float32 may lose.

    The margin rule: positions and speeds move by ±1e-4, accelerations by ±1e-6 m/s², each vehicle's signs at random.
    """
    intersection = twin_map(name)
    truth = reference_worlds.step(intersection, state, action, rules, newcomers, is_last)
    generator = np.random.default_rng(0)
    for _ in range(NUDGES):
        position, speed, push = generator.choice([-1.0, 1.0], (3, len(action)))
        traffic = replace(
            state.traffic,
            position=state.traffic.position + ROUNDING * position,
            speed=state.traffic.speed + ROUNDING * speed,
        )
        nudged = reference_worlds.step(
            intersection, replace(state, traffic=traffic), action + push * 1e-6 / 6, rules, newcomers, is_last
        )
        same = all((getattr(nudged, flag) == getattr(truth, flag)).all() for flag in FLAGS)
        same = same and nudged.done == truth.done
        same = same and bool((nudged.state.delta == truth.state.delta).all())
        same = same and bool((nudged.state.hold == truth.state.hold).all())
        near = np.allclose(nudged.observation, truth.observation, atol=0.01)
        if not (same and near and np.allclose(nudged.reward, truth.reward, atol=0.2)):
            return True
    return False


# Rollouts


ROLLOUT = {
    "observation": np.float32,
    "latent": np.float32,
    "log_probability": np.float32,
    "value_now": np.float32,
    "value_next": np.float32,
    "reward": np.float32,
    "terminated": np.bool_,
    "cut": np.bool_,
}


def rolled_out(
    loop: _core.ClosedLoop | _core.Replay, policy: NDArray[np.float32], value: NDArray[np.float32], steps: int
) -> Arrays:
    """The results of a rollout with sigma 0.5, each (world, step[, vehicle][, feature])."""
    shape = (loop.action.shape[0], steps, *loop.action.shape[1:])
    arrays = {name: np.zeros((*shape, 12) if name == "observation" else shape, kind) for name, kind in ROLLOUT.items()}
    loop.rollout(policy, value, 0.5, steps, **arrays)
    return arrays


def network_parameters(generator: np.random.Generator) -> NDArray[np.float32]:
    """A driving or value network as the core takes it: of each layer weights, then biases; the scaling folded in."""
    scale = np.array([0.05, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 0.03, 0.08, 1.0])
    layers = [
        generator.normal(0, 0.3, (16, 12)) * scale,
        generator.normal(0, 0.3, (16, 16)),
        generator.normal(0, 0.3, 16),
    ]
    biases = [generator.normal(0, 0.1, size) for size in (16, 16, 1)]
    parts = [part.ravel() for pair in zip(layers, biases, strict=True) for part in pair]
    return np.concatenate(parts).astype(np.float32)


def network_answers(parameters: NDArray[np.float32], features: NDArray[np.float32]) -> NDArray[np.float64]:
    """(...,): what such a network says to features (..., 12)."""
    p, x = parameters.astype(np.float64), features.astype(np.float64)
    x = np.tanh(x @ p[:192].reshape(16, 12).T + p[192:208])
    x = np.tanh(x @ p[208:464].reshape(16, 16).T + p[464:480])
    return np.asarray(x @ p[480:496] + p[496])


def check_rollouts(
    rolling: _core.ClosedLoop | _core.Replay, stepping: _core.ClosedLoop | _core.Replay, rounds: int, steps: int = 5
) -> dict[str, float]:
    """Asserts that rollouts are what stepping with their actions gives; returns how much happened, on average.

    The states are brought together before each, for the core's tanh differs from numpy's in the last digits.
    """
    generator = np.random.default_rng(0)
    policy, value = network_parameters(generator), network_parameters(generator)
    noises, met = [], []
    for _ in range(rounds):
        stepping.set_state(rolling.state())
        seen = rolled_out(rolling, policy, value, steps)
        noise = (seen["latent"] - network_answers(policy, seen["observation"])) / 0.5
        log_probability = -0.5 * noise**2 - np.log(0.5) - 0.5 * np.log(2 * np.pi)
        np.testing.assert_allclose(seen["log_probability"], log_probability, atol=1e-3)
        np.testing.assert_allclose(seen["value_now"], network_answers(value, seen["observation"]), atol=1e-4)
        for step in range(steps):
            check_step(stepping, value, {name: values[:, step] for name, values in seen.items()})
        np.testing.assert_allclose(rolling.observation, stepping.observation, atol=1e-3)
        noises.append(noise)
        met.append([seen[name].mean() for name in ("terminated", "cut")])
    drawn = np.array(noises)
    assert abs(drawn.mean()) < 4 / np.sqrt(drawn.size)
    assert abs(drawn.std() - 1) < 4 / np.sqrt(drawn.size)
    assert len(np.unique(drawn.round(6))) > 0.9 * drawn.size
    return dict(zip(("terminated", "cut"), np.mean(met, axis=0).tolist(), strict=True))


def check_step(stepping: _core.ClosedLoop | _core.Replay, value: NDArray[np.float32], seen: Arrays) -> None:
    """Asserts that one step of a rollout is that of the worlds; seen: its results (world[, vehicle][, feature])."""
    np.testing.assert_allclose(stepping.observation, seen["observation"], atol=1e-3)
    stepping.action[:] = np.tanh(seen["latent"].astype(np.float64)).astype(np.float32)
    stepping.step()
    cut = stepping.terminated | stepping.truncated
    if isinstance(stepping, _core.ClosedLoop):
        cut |= stepping.reinserted
    np.testing.assert_array_equal(stepping.terminated, seen["terminated"])
    np.testing.assert_array_equal(cut, seen["cut"])
    np.testing.assert_allclose(stepping.reward, seen["reward"], atol=0.05)
    last = np.where(cut[..., None], stepping.final_observation, stepping.observation)
    np.testing.assert_allclose(network_answers(value, last), seen["value_next"], atol=1e-3)


# Recorded scenes


def window(scene: Scene, begin: int, steps: int) -> reference_worlds.Scene:
    """Some steps of a recorded scene, as the twin has it; tracks that are not recorded there are left out."""
    tracks = []
    for track in scene.tracks:
        first, stop = max(track.start, begin), min(track.stop, begin + steps)
        part = slice(first - track.start, stop - track.start)
        if first >= stop or not track.observed[part].any():
            continue
        one = reference_worlds.Track(
            route=track.route,
            length=float(np.float32(track.length)),
            width=float(np.float32(track.width)),
            max_speed=BICYCLE_MAX_SPEED if track.road_user == "bicycle" else np.inf,
            start=first - begin,
            position=track.position[part].astype(np.float64),
            speed=track.speed[part].astype(np.float64),
            observed=track.observed[part].astype(np.bool_),
        )
        tracks.append(one)
    return reference_worlds.Scene(min(steps, scene.steps - begin), tuple(tracks))


def driven(
    name: str,
    route: str,
    position: float,
    speed: float | Sequence[float],
    steps: int = 60,
    start: int = 0,
    length: float = 4.0,
    max_speed: float = np.inf,
) -> reference_worlds.Track:
    """A vehicle recorded at a constant speed, or at these speeds; 4 m by 2 m."""
    fast = np.broadcast_to(np.asarray(speed, np.float32).astype(np.float64), steps).copy()
    travelled = np.concatenate([[0.0], np.cumsum(reference.TIME_STEP * (fast[:-1] + fast[1:]) / 2)])
    where = (position + travelled).astype(np.float32).astype(np.float64)
    index = Intersection.load(name).route_index(route)
    return reference_worlds.Track(index, length, 2.0, max_speed, start, where, fast, np.ones(steps, np.bool_))


def scene_of(*tracks: reference_worlds.Track) -> reference_worlds.Scene:
    return reference_worlds.Scene(max(track.stop for track in tracks), tracks)


def can_act(track: reference_worlds.Track) -> bool:
    """Whether there is a step to drive."""
    return track.first_recorded < track.stop - 1


def core_of_scenes(scenes: Sequence[reference_worlds.Scene]) -> Arrays:
    """The scenes as the core's replay takes them."""
    tracks = [track for scene in scenes for track in scene.tracks]

    def joined(name: str, dtype: type) -> NDArray[Any]:
        return np.concatenate([getattr(track, name) for track in tracks]).astype(dtype)

    return {
        "scene_steps": np.array([scene.steps for scene in scenes], np.int32),
        "scene_tracks": np.cumsum([0, *(len(scene.tracks) for scene in scenes)], dtype=np.int64),
        "track_route": np.array([track.route for track in tracks], np.int32),
        "track_length": np.array([track.length for track in tracks], np.float32),
        "track_width": np.array([track.width for track in tracks], np.float32),
        "track_max_speed": np.array([track.max_speed for track in tracks], np.float32),
        "track_start": np.array([track.start for track in tracks], np.int32),
        "track_samples": np.cumsum([0, *(len(track.position) for track in tracks)], dtype=np.int64),
        "position": joined("position", np.float32),
        "speed": joined("speed", np.float32),
        "observed": joined("observed", np.bool_),
    }


def replay(
    name: str,
    scenes: Sequence[reference_worlds.Scene],
    worlds: int = 1,
    *,
    decisions: str = "recording",
    actors: Sequence[int] | None = None,
    autoreset: str = "off",
    threads: int = 1,
    isa: str | None = None,
) -> _core.Replay:
    """Replayed scenes on a shipped map; decisions: "recording", or a gap rule or "network"."""
    _, policy = rules_and_policy("critical_gap" if decisions == "recording" else decisions)
    arrays = core_of_scenes(scenes)
    tracks = [track for scene in scenes for track in scene.tracks]
    able = [number for number, track in enumerate(tracks) if can_act(track)]
    chosen = np.array(able if actors is None else actors)
    return _core.Replay(
        Intersection.load(name).core,
        policy,
        decisions == "recording",
        arrays,
        chosen.astype(np.int32),
        worlds,
        autoreset,
        threads,
        isa,
    )
