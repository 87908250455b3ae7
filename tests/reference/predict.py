"""One prediction: all vehicles observed, decided, driven and advanced, step by step."""

from dataclasses import dataclass

import numpy as np

from tests.reference.decide import Chooser, Gap, Rules, decide, holds, say
from tests.reference.drive import PAPER_IDM, Driver, Idm, advance, drive, free_speed
from tests.reference.intersection import Booleans, Floats, Integers, Map
from tests.reference.memory import Memory, initial_memory
from tests.reference.networks import Network
from tests.reference.observe import Feature, observe
from tests.reference.orders import complete
from tests.reference.outputs import minimum_distance, overlapping, time_loss
from tests.reference.pairs import conflicts
from tests.reference.stops import with_stops
from tests.reference.traffic import TIME_STEP, Traffic

STEPS = 50


@dataclass(frozen=True)
class Prediction:
    """time (time,); position, speed, acceleration, enters, present, hold, waited (time, vehicle).

    time_loss: (vehicle,) [s].
    """

    time: Floats
    position: Floats
    speed: Floats
    acceleration: Floats
    enters: Booleans
    present: Booleans
    hold: Integers
    waited: Integers
    time_loss: Floats
    minimum_distance: float


def predict(
    intersection: Map,
    traffic: Traffic,
    assignments: Integers | None = None,
    *,
    gap: Gap = "critical_gap",
    driver: Driver = "idm",
    gap_network: Network | None = None,
    driver_network: Network | None = None,
    idm_parameters: Idm = PAPER_IDM,
    delta: Booleans | None = None,
    steps: int = STEPS,
    memory: Memory | None = None,
    patience: Floats | None = None,
) -> Prediction:
    """Rolls one scenario out; assignments: (pair,); delta: (step, vehicle) decisions to replay. memory: what
    everybody remembers; without, as at a start. patience: (vehicle,); without, none is kept.

    Raises: ValueError for assignments that contradict lane order, each other, or what a vehicle can still do.
    """
    pairs, apart = conflicts(intersection, traffic), overlapping(intersection, traffic)
    given = np.zeros(len(pairs), dtype=np.int64) if assignments is None else assignments
    chooser = Chooser(pairs, complete(intersection, traffic, given, memory), Rules(gap, gap_network, patience))
    memory = initial_memory(intersection, traffic) if memory is None else memory
    states, presences = [traffic], [memory.present]
    enters, reached, held, waited = [], [], [], []
    for step in range(steps):
        memory = with_stops(intersection, traffic, memory)
        observation = observe(intersection, traffic, memory, pairs)
        says = say(intersection, traffic, memory, chooser, observation)
        decided = decide(intersection, traffic, memory, says) if delta is None else delta[step].astype(np.bool_)
        hold = holds(intersection, traffic, memory, decided, says)
        observation.driving[:, Feature.DELTA] = decided
        wanted = _wanted(intersection, traffic, observation.driving, driver, driver_network, idm_parameters)
        traffic, present, acceleration = advance(intersection, traffic, memory.present, wanted)
        memory = Memory(present, decided, hold, memory.waited)
        states.append(traffic)
        presences.append(present)
        enters.append(decided)
        reached.append(acceleration)
        held.append(hold)
        waited.append(memory.waited)
    return Prediction(
        time=np.array([TIME_STEP * step for step in range(steps + 1)]),
        position=np.array([state.position for state in states]),
        speed=np.array([state.speed for state in states]),
        acceleration=np.array([*reached, reached[-1]]),
        enters=np.array([*enters, enters[-1]]),
        present=np.array(presences),
        hold=np.array([*held, held[-1]]),
        waited=np.array([*waited, waited[-1]]),
        time_loss=time_loss(intersection, states[:-1], presences[:-1]),
        minimum_distance=min(
            minimum_distance(intersection, *moment, apart) for moment in zip(states, presences, strict=True)
        ),
    )


def _wanted(
    intersection: Map, traffic: Traffic, driving: Floats, driver: Driver, network: Network | None, p: Idm
) -> Floats:
    """(vehicle,) [m/s²]: what each does at what it sees (vehicle, 12)."""
    free = [free_speed(intersection, traffic, i, p) if driver == "idm" else 0.0 for i in range(len(driving))]
    rows = zip(driving, free, traffic.max_speed.tolist(), strict=True)
    return np.array([drive(features, driver, network, v, top, p) for features, v, top in rows])
