"""One step of the closed loop, and the ends of a world."""

from dataclasses import dataclass, field, replace

import numpy as np

from tests.reference.collisions import collisions
from tests.reference.decide import Chooser, Rules, decide, holds, say
from tests.reference.drive import NETWORK_ACCELERATION
from tests.reference.intersection import Booleans, Floats, Integers, Map
from tests.reference.memory import Memory
from tests.reference.observe import Feature, Observation, alone, observe
from tests.reference.pairs import all_pairs
from tests.reference.reward import penalties, reward
from tests.reference.stops import with_stops
from tests.reference.traffic import FIELDS, TIME_STEP, Traffic


@dataclass(frozen=True)
class State:
    """A world after its decisions; delta, hold, waited: (vehicle,); by default nobody has waited."""

    traffic: Traffic
    delta: Booleans
    hold: Integers
    waited: Integers = field(default=None)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        if self.waited is None:
            object.__setattr__(self, "waited", np.zeros(len(self.delta), np.int64))


@dataclass(frozen=True)
class Step:
    """What follows from one step; rows of final_observation count where a flag is set. All (vehicle, ...)."""

    state: State
    observation: Floats
    final_observation: Floats
    reward: Floats
    terminated: Booleans
    truncated: Booleans
    reinserted: Booleans
    done: bool


def decided(
    intersection: Map, traffic: Traffic, delta: Booleans, hold: Integers, rules: Rules, waited: Integers | None = None
) -> tuple[State, Observation]:
    """The traffic with its decisions, from what is remembered; and what is seen."""
    pairs = all_pairs(intersection, traffic)
    waited = np.zeros(len(delta), np.int64) if waited is None else waited
    memory = with_stops(intersection, traffic, Memory(np.ones(len(traffic.route), np.bool_), delta, hold, waited))
    chooser = Chooser(pairs, np.zeros(len(pairs), np.int64), rules)
    seen = observe(intersection, traffic, memory, pairs)
    says = say(intersection, traffic, memory, chooser, seen)
    enters = decide(intersection, traffic, memory, says)
    seen.driving[:, Feature.DELTA] = enters
    return State(traffic, enters, holds(intersection, traffic, memory, enters, says), memory.waited), seen


def moved(intersection: Map, traffic: Traffic, acceleration: Floats) -> tuple[Traffic, Booleans]:
    """The traffic one step later, nobody reinserted; and who has left (vehicle,)."""
    speed = traffic.speed + TIME_STEP * acceleration
    position = traffic.position + TIME_STEP * (traffic.speed + speed) / 2
    length = np.array([intersection.routes[r].length for r in traffic.route])
    return replace(traffic, position=position, speed=speed), (position >= length) | (position < 0)


def seated(traffic: Traffic, left: Booleans, newcomers: Traffic) -> Traffic:
    """The traffic, with the rows of those that left taken from the newcomers."""
    return Traffic(*(np.where(left, getattr(newcomers, name), getattr(traffic, name)) for name in FIELDS))


def step(
    intersection: Map,
    state: State,
    action: Floats,
    rules: Rules,
    newcomers: Traffic | None = None,
    is_last_cycle: bool = False,
    bodies: str = "circles",
) -> Step:
    """One step of the closed loop; action: (vehicle,) in [-1, 1].

    newcomers: whose rows take the places of vehicles that leave; needed only where one does.
    """
    acceleration = NETWORK_ACCELERATION * action
    traffic, left = moved(intersection, state.traffic, acceleration)
    final = {i: alone(intersection, traffic, i) for i in np.flatnonzero(left).tolist()}
    if left.any():
        assert newcomers is not None, f"vehicles {np.flatnonzero(left)} leave"
        traffic = seated(traffic, left, newcomers)
    memories = state.delta & ~left, np.where(left, -1, state.hold)
    new, seen = decided(intersection, traffic, *memories, rules, np.where(left, 0, state.waited))
    involved, blamed = collisions(intersection, traffic, left, new.waited, bodies)
    final_observation = seen.driving.copy()
    for i, features in final.items():
        final_observation[i] = features
    worth = [reward(final_observation[i], float(acceleration[i]), bool(blamed[i])) for i in range(len(left))]
    comes_badly = any(penalties(seen.driving[i]).violate(slow_counts=False) for i in final)
    done = bool(involved.any()) or comes_badly or is_last_cycle
    return Step(
        state=new,
        observation=seen.driving,
        final_observation=final_observation,
        reward=np.array(worth),
        terminated=blamed,
        truncated=~blamed & done,
        reinserted=left & (not done),
        done=done,
    )
