"""The C++ core: maps, conflicts, crossing orders, prediction."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy
from numpy.typing import NDArray


class FormatError(ValueError):
    pass

DT: float = 0.20000000298023224

STEPS: int = 50

MAX_VEHICLES: int = 64

MOST_THREADS: int = 256

BRAKING: float = 4.0

DRIVES: float = 1.0

STOPPED: float = 0.5

AT_LINE: float = 3.0

LEAST_SIZE: float = 0.10000000149011612

MOST_LENGTH: float = 50.0

MOST_WIDTH: float = 10.0

MOST_SPEED: float = 100.0

ASIDE: float = 2.0

TURNED: float = 0.785

PLAIN_LANE: float = 3.5

WORTHWHILE_GAIN: float = 2.0

MOST_MANEUVERS: int = 10000

MOST_COUNTED: int = 20000

SPREAD_LEVELS: int = 19

SPREAD_SECONDS: int = 10

def available_kernels() -> list[str]:
    """The instruction sets of this machine's kernels, best last."""

def gap_features() -> list[str]:
    """The gap network's inputs, by name and unit."""

def driving_features() -> list[str]:
    """The driving network's inputs, by name and unit."""

def order_features() -> list[str]:
    """The order network's inputs, by name and unit."""

def spread_ways() -> list[float]:
    """The ways at which a spread has a scale [m]."""

def multiply_adds(isa: str, rounds: int) -> tuple[int, float]:
    """
    Does float32 multiply-adds as fast as this kernel can; how many, and a number they end in.
    """

def tanhs(isa: str, rounds: int) -> tuple[int, float]:
    """Likewise tanh."""

def usable_cores(groups: str = '/sys/fs/cgroup') -> int:
    """How many cores this process may use."""

def orders_in_a_cycle(vehicles: int) -> int:
    """How many orders a planner's cycle has time for."""

def kernel_name() -> str:
    """The kernel in use."""

class Route:
    @property
    def id(self) -> str: ...

    @property
    def length(self) -> float: ...

    @property
    def stop_line(self) -> float: ...

    @property
    def must_stop(self) -> bool: ...

    @property
    def stop_lane(self) -> int: ...

    @property
    def rank(self) -> int: ...

    @property
    def junction(self) -> tuple[float, float]: ...

    @property
    def first_conflict(self) -> float: ...

    @property
    def sample_count(self) -> int: ...

class Map:
    def __init__(self, text: str, where: str) -> None:
        """
        Reads the text of a compiled map, named `where` in errors; raises FormatError.
        """

    @property
    def name(self) -> str: ...

    @property
    def locations(self) -> list[int]: ...

    @property
    def spacing(self) -> float: ...

    @property
    def checksum(self) -> int: ...

    @property
    def heading_offsets(self) -> list[float]: ...

    @property
    def routes(self) -> list[Route]: ...

    @property
    def conflicts(self) -> list[tuple[int, int, bool, bool, float, float, float, float, float]]:
        """
        Rows of yielder, prioritized, merging, by arrival, the interval on each, and the line [m].
        """

    @property
    def shared_lanes(self) -> list[tuple[int, int, float, float, float, float]]:
        """Rows of a, b, begin on a, begin on b, end on a, offset [m]."""

    @property
    def has_stops(self) -> bool:
        """Whether somebody has to make a stop."""

    def sample(self, route: int, position: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
        """
        (position, 11): x, y, heading, width, v_max, six relative headings, interpolated.
        """

    def project(self, route: int, points: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Of points (point, 2) the nearest places on a route: position, distance, excess (point,) [m].
        """

    def locate(self, x: float, y: float, heading: float, aside: float, turned: float) -> list[tuple[int, float, float, float]]:
        """
        The routes that fit: rows of route, position, lateral offset [m] and turn [rad].
        """

class Traffic:
    """The vehicles at one moment, checked."""

    def __init__(self, map: Map, route: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], position: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], speed: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], length: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], width: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], max_speed: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], delta: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, hold: Annotated[NDArray[numpy.int16], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, waited: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, patience: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None) -> None: ...

def conflicts(map: Map, traffic: Traffic) -> NDArray[numpy.int32]:
    """(pair, 2): yielder and prioritized vehicle of every open pair."""

def lane_order(map: Map, traffic: Traffic) -> NDArray[numpy.int32]:
    """
    (arc, 2): a vehicle before its stop line, and the next behind it in that lane.
    """

def committed(map: Map, traffic: Traffic) -> NDArray[numpy.bool_]:
    """(vehicle,): goes, and is past stopping at its line."""

def closest(map: Map, traffic: Traffic) -> tuple[float, int, int] | None:
    """
    The smallest distance between two vehicles [m] and their indices, or None.
    """

def overlaps(map: Map, traffic: Traffic) -> list[tuple[int, int]]:
    """Pairs of vehicles whose bodies overlap."""

def doubted_speeds(map: Map, traffic: Traffic) -> list[int]:
    """The vehicles that are faster than anybody drives there: km/h for m/s."""

def collision(map: Map, traffic: Traffic, bodies: str = 'circles') -> tuple[int, int] | None:
    """
    The first two vehicles that collide, now or once both have braked fully, or None.
    """

def complete(map: Map, traffic: Traffic, assignments: Annotated[NDArray[numpy.int8], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.int8]:
    """
    (scenario, pair): the assignments and what they imply; raises ValueError for a contradiction.
    """

def carry_priorities(map: Map, before: Traffic, priorities: Annotated[NDArray[numpy.int8], dict(shape=(None,), order='C', device='cpu', writable=False)], vehicles: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], after: Traffic) -> NDArray[numpy.int8]:
    """
    (pair after,): the priorities (pair before,) of the pairs still open; vehicles: (vehicle after,) indices before.
    """

class Orders:
    """Streams the crossing orders of a traffic."""

    def __init__(self, map: Map, traffic: Traffic, cooperative: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)], preferred: Annotated[NDArray[numpy.int8], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def next(self, most: int) -> NDArray[numpy.int8]:
        """(order, pair): up to `most` further orders."""

    def count_remaining(self, most: int) -> int:
        """How many are left, counted up to `most`."""

class Policy:
    def __init__(self, text: str, where: str) -> None:
        """
        Reads the text of a policy file, named `where` in errors; raises FormatError.
        """

    @property
    def about(self) -> str:
        """Provenance and scores, JSON."""

    def evaluate_gap(self, features: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
        """(row,): logits of accepting the gap."""

    @property
    def can_forecast(self) -> bool:
        """Whether it holds an order network and a spread."""

    def evaluate_order(self, features: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
        """(row,): logits of the yielder going first."""

    def evaluate_driving(self, features: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
        """(row,): the driving network's output before its last tanh."""

class Predictor:
    def __init__(self, map: Map, policy: Policy, threads: int = 1, patience: str | None = None) -> None:
        """patience: "none" or "kept"; None: the default of its gap decision."""

    @property
    def patience_kept(self) -> bool:
        """Whether drivers keep the quantile by which they accept gaps."""

    def observe(self, traffic: Traffic) -> tuple[NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.uint8]]:
        """
        driving (vehicle, 12) and gap (pair, 4) features, and which pairs' gaps are accepted (pair,).
        """

    def observe_orders(self, traffic: Traffic) -> NDArray[numpy.float32]:
        """(pair, 21): what an order network sees."""

    def predict(self, traffic: Traffic, assignments: Annotated[NDArray[numpy.int8], dict(shape=(None, None), order='C', device='cpu', writable=False)], trajectories: bool, safety: bool, decisions: Annotated[NDArray[numpy.uint8], dict(shape=(None, None, None), order='C', writable=False)] | None = None, isa: str | None = None) -> tuple[NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.uint8], NDArray[numpy.uint8], NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.int16], NDArray[numpy.int8], NDArray[numpy.int32] | None, NDArray[numpy.float32]]:
        """
        position, speed, acceleration, enters, present, time_loss, minimum_distance, hold, completed assignments, waited, patience.
        """

    def summarize(self, traffic: Traffic, assignments: Annotated[NDArray[numpy.int8], dict(shape=(None, None), order='C', device='cpu', writable=False)], safety: bool, isa: str | None = None, apart: bool = False) -> tuple[NDArray[numpy.float32], NDArray[numpy.float32]]:
        """
        time_loss, minimum_distance: as of predict, without trajectories. apart: each scenario by itself, whatever it has in common with others.
        """

    def keeps_patience(self, traffic: Traffic) -> bool:
        """Whether drivers keep anything in a prediction of this traffic."""

    def patience(self, traffic: Traffic, levels: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
        """
        (vehicle,): the patience of the driver at each vehicle's level (vehicle,).
        """

def rank_maneuvers(predictor: Predictor, traffic: Traffic, cooperative: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)], limit: int | None, seconds: float, by_expectation: bool | None) -> tuple[dict[str, Any], int]:
    """
    Every crossing order and no intervention, ranked: columns (maneuver,), priorities (maneuver, pair); and how many orders were left out.
    """

def order_probabilities(predictor: Predictor, traffic: Traffic, given: Annotated[NDArray[numpy.int8], dict(shape=(None,), order='C', device='cpu', writable=False)], mass: float, most: int, feasible: int, seconds: float = float('inf')) -> tuple[NDArray[numpy.int8], NDArray[numpy.float64], NDArray[numpy.float64], int, int]:
    """
    The most probable orders (order, pair) and their probability (order,), that of each yielder going first (pair,), how many orders are feasible and how many were left out.
    """

def position_quantiles(policy: Policy, probability: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], position: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], levels: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float32]:
    """(level, time, vehicle) of positions (order, time, vehicle) [m]."""

def crossing_order(map: Map, traffic: Traffic, position: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)]) -> NDArray[numpy.int8]:
    """
    (scenario, pair): who reached each conflict first in positions (scenario, time, vehicle).
    """

def in_words(map: Map, traffic: Traffic, names: Sequence[str], orders: Annotated[NDArray[numpy.int8], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> list[str]:
    """Orders (order, pair) as sequences of vehicles."""

class ClosedLoop:
    """
    Closed-loop worlds; the arrays are views of what the next step overwrites.
    """

    def __init__(self, map: Map, policy: Policy, worlds: int, vehicles: int, max_cycles: int, autoreset: str, threads: int, isa: str | None = None, bodies: str = 'circles') -> None: ...

    @property
    def is_plain(self) -> bool:
        """
        Whether no two routes of the map have more to do with each other than a lane before a split, or one conflict and the lane after it: steps are faster then.
        """

    def reset(self, seed: int, desynchronise: bool) -> None: ...

    def reset_worlds(self, mask: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def step(self) -> None: ...

    def rollout(self, policy: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], value: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], sigma: float, steps: int, observation: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], latent: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], log_probability: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], value_now: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], value_next: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], reward: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], terminated: Annotated[NDArray[numpy.bool_], dict(order='C', device='cpu')], cut: Annotated[NDArray[numpy.bool_], dict(order='C', device='cpu')]) -> None:
        """
        Steps with the policy inside; fills arrays (world, step, vehicle[, feature]).
        """

    def state(self) -> dict[str, Any]:
        """Everything, as arrays (world, vehicle), (world,) and (world, 8)."""

    def set_state(self, state: dict[str, Any]) -> None: ...

    @property
    def action(self) -> NDArray[numpy.float32]: ...

    @property
    def reward(self) -> NDArray[numpy.float32]: ...

    @property
    def observation(self) -> NDArray[numpy.float32]: ...

    @property
    def final_observation(self) -> NDArray[numpy.float32]: ...

    @property
    def terminated(self) -> NDArray[numpy.bool_]: ...

    @property
    def truncated(self) -> NDArray[numpy.bool_]: ...

    @property
    def reinserted(self) -> NDArray[numpy.bool_]: ...

    @property
    def done(self) -> NDArray[numpy.bool_]: ...

class Replay:
    """Replay worlds; the arrays are views of what the next step overwrites."""

    def __init__(self, map: Map, policy: Policy, recording: bool, scenes: dict[str, Any], actors: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], worlds: int, autoreset: str, threads: int, isa: str | None = None, bodies: str = 'circles') -> None: ...

    def reset(self, seed: int, desynchronise: bool) -> None: ...

    def reset_worlds(self, mask: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def start(self, world: int, track: int) -> None:
        """Begins this world's episode with this track."""

    def step(self) -> None: ...

    def rollout(self, policy: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], value: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], sigma: float, steps: int, observation: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], latent: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], log_probability: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], value_now: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], value_next: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], reward: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu')], terminated: Annotated[NDArray[numpy.bool_], dict(order='C', device='cpu')], cut: Annotated[NDArray[numpy.bool_], dict(order='C', device='cpu')]) -> None:
        """Steps with the policy inside; fills arrays (world, step[, feature])."""

    def state(self) -> dict[str, Any]:
        """Everything, as arrays (world,) and (world, 8)."""

    def set_state(self, state: dict[str, Any]) -> None: ...

    @property
    def action(self) -> NDArray[numpy.float32]: ...

    @property
    def reward(self) -> NDArray[numpy.float32]: ...

    @property
    def expert_acceleration(self) -> NDArray[numpy.float32]: ...

    @property
    def observation(self) -> NDArray[numpy.float32]: ...

    @property
    def final_observation(self) -> NDArray[numpy.float32]: ...

    @property
    def expert_observation(self) -> NDArray[numpy.float32]: ...

    @property
    def terminated(self) -> NDArray[numpy.bool_]: ...

    @property
    def truncated(self) -> NDArray[numpy.bool_]: ...

    @property
    def track(self) -> NDArray[numpy.int32]: ...

    @property
    def time(self) -> NDArray[numpy.int32]: ...
