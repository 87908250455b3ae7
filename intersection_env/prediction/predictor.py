"""Predicts the next 10 s of a traffic, for one priority assignment or for thousands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intersection_env import _core
from intersection_env.arguments import check_type, whole_number
from intersection_env.constants import DT, STEPS
from intersection_env.maps.intersection import Intersection
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import DEFAULT, policy_named
from intersection_env.traffic import Traffic, naming

Patience = Literal["none", "kept"]
DEFAULT_PATIENCE: Patience = "none"
Priorities = Sequence[tuple[str, str]] | NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Summary:
    """What planners compare.

    time_loss: (scenario, vehicle) over the horizon [s]; paper, Eq. (5).
    minimum_distance: (scenario,) smallest distance over time between any two vehicles that can touch [m],
        infinite where none can.
    """

    traffic: Traffic
    time_loss: NDArray[np.float32]
    minimum_distance: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Trajectories and their summary.

    time: (51,) [s], from now.
    position, speed: (scenario, time, vehicle) [m], [m/s]; along each vehicle's own route.
    acceleration: (scenario, time, vehicle) [m/s²], over the step that begins there; the last entry repeats.
    enters: (scenario, time, vehicle) bool, the gap decision of that step.
    present: (scenario, time, vehicle) bool, not yet at its route's end; the other values stay as they were there.
    time_loss, minimum_distance: as in `Summary`.
    hold: (scenario, time, vehicle) int16, whom it lets go from that step on, as in `Traffic`; None where the
        trajectories are not a `Predictor`'s.
    priorities: (scenario, pair) int8, those asked for and what they imply; None likewise.
    waited: (scenario, time, vehicle) int32, since its stop, as in `Traffic`, that step included; None likewise, and
        where the map has no stops.
    patience: (vehicle,) float32, what drivers keep, as in `Traffic`; None where they keep nothing.
    """

    traffic: Traffic
    time: NDArray[np.float32]
    position: NDArray[np.float32]
    speed: NDArray[np.float32]
    acceleration: NDArray[np.float32]
    enters: NDArray[np.bool_]
    present: NDArray[np.bool_]
    time_loss: NDArray[np.float32]
    minimum_distance: NDArray[np.float32]
    hold: NDArray[np.int16] | None = None
    priorities: NDArray[np.int8] | None = None
    waited: NDArray[np.int32] | None = None
    patience: NDArray[np.float32] | None = None

    def traffic_at(self, time: float, scenario: int = 0) -> Traffic:
        """The vehicles still present at a time, with what they remember: predicted on, it goes on as this prediction.

        Without priorities that holds to the byte; to keep to a scenario's order, predict with `priorities_at`. With
        those it holds unless they imply more by then: who could not stop at first may be able to later, and then waits
        behind whoever was told to wait ahead of it.

        Args:
            time: [s] from now, one of `time`.
            scenario: which one.

        Raises:
            ValueError: another time or scenario, or trajectories that are not a `Predictor`'s.
        """
        step = self._step(time, scenario)
        if self.hold is None:
            raise ValueError(
                "these trajectories are not those of one traffic by a Predictor: nobody knows what vehicles remember"
            )
        on, start = self.present[scenario, step], self.traffic
        delta, hold, waited = start.delta, start.hold, start.waited
        if step > 0:
            delta, hold = self.enters[scenario, step - 1], self.hold[scenario, step - 1]
            waited = None if self.waited is None else self.waited[scenario, step - 1]
        return Traffic(
            start.intersection,
            tuple(start.ids[i] for i in np.flatnonzero(on)),
            start.route[on],
            self.position[scenario, step, on],
            self.speed[scenario, step, on],
            start.length[on],
            start.width[on],
            start.max_speed[on],
            None if delta is None else delta[on],
            None if hold is None else hold[on],
            None if waited is None else waited[on],
            None if self.patience is None else self.patience[on],
        )

    def priorities_at(self, time: float, scenario: int = 0) -> NDArray[np.int8]:
        """The scenario's priorities for `traffic_at` that time: (pair,) over its `conflicts`.

        Raises:
            ValueError: as in `traffic_at`; or vehicles of one lane have passed through each other, as some do that are
                too near from the start, so that the order cannot be kept to.
        """
        later = self.traffic_at(time, scenario)
        if self.priorities is None:
            raise ValueError("these trajectories are not a Predictor's: no priorities were asked for")
        vehicles = np.flatnonzero(self.present[scenario, self._step(time, scenario)]).astype(np.int32)
        before = self.traffic.core, self.priorities[scenario]
        with naming(later.ids):
            return _core.carry_priorities(self.traffic.intersection.core, *before, vehicles, later.core)

    def _step(self, time: float, scenario: int) -> int:
        if not 0 <= scenario < len(self.present):
            raise ValueError(f"scenario must be from 0 to {len(self.present) - 1}, not {scenario}")
        step = int(np.abs(self.time - time).argmin())
        if not abs(float(self.time[step]) - time) < DT / 100:
            raise ValueError(f"time must be a multiple of {DT:.1f} s from 0 to {self.time[-1]:.1f}, not {time}")
        return step


@dataclass(frozen=True, eq=False)
class Observation:
    """What the networks see at one moment; paper, Table I.

    driving: (vehicle, 12) distance to the stop line [m], speed, v_max [m/s], relative heading at -10, -3, 3, 10,
        30 and 100 m [rad], distance to the lead [m] and its speed [m/s], gap decision (0 or 1).
    gap: (pair, 4) over `traffic.conflicts`: the yielder's distance to the point of guaranteed arrival [m] and speed
        [m/s], the other's distance to its stop line [m] and speed [m/s].
    accepts: (pair,) bool, whether the policy accepts the gap.
    """

    driving: NDArray[np.float32]
    gap: NDArray[np.float32]
    accepts: NDArray[np.bool_]


class Predictor:
    """A policy that predicts traffic on any map."""

    def __init__(self, policy: PolicyFile, name: str, threads: int = 1, *, patience: Patience | None = None) -> None:
        """A predictor by this policy (`load` knows those that ship, and says what `threads` and `patience` do)."""
        self.name = name
        self.policy = policy
        self.threads = whole_number("threads", threads)
        if not 0 <= threads <= _core.MOST_THREADS:
            raise ValueError(f"threads must be from 0, one a core, to {_core.MOST_THREADS}, not {threads}")
        if patience not in (None, "none", "kept"):
            raise ValueError(f'patience must be "none", "kept" or None, not {patience!r}')
        if patience == "kept" and policy.gap != "network":
            raise ValueError(
                f'patience: in "{name}" {policy.gap} decides about gaps, not a network, so drivers have no quantiles'
            )
        self.patience = patience or (DEFAULT_PATIENCE if policy.gap == "network" else "none")
        self.core_policy = _core.Policy(policy.text(), name)
        self._bound: dict[str, _core.Predictor] = {}

    @classmethod
    def load(
        cls,
        policy: str | Path = DEFAULT,
        *,
        gap: str | None = None,
        threads: int = 1,
        patience: Patience | None = None,
    ) -> Predictor:
        """A policy that ships, a rule (`"idm"`, `"constant_velocity"`) or a policy file (`.policy`).

        All that ship were trained on the simulated recordings, and a network decides about gaps, in
        `"rollout_gradient"` one of its own. Who drives: in `"rollout_gradient"` a network that learned from the errors
        of its own predictions, in `"gail"` one that learned to drive like the recorded ones, in `"ppo"` one that
        learned by reward in the closed loop, as GAIL's did to begin with; in `"gap"` the IDM with the paper's
        parameters, in `"idm_calibrated"` with those that fit the recordings.

        Args:
            policy: a name or a path; by default the one that predicts best of those that pass the gates
                (`intersection_env.evaluation.gates`).
            gap: for rules only, who accepts a gap: `"critical_gap"` (default; 6 s crossing, 4 s merging) or `"sumo"`.
            threads: how many share the scenarios of a large batch, 0: one a core. They do not change what comes out.
                They help one caller at a time; whoever predicts meanwhile, in another thread, works alone.
            patience: where a network decides about gaps, "none" has every driver accept what at least half of all
                drivers would, decided anew at each step, as in the paper; with "kept" who stands at its line has
                refused what is there, and keeps to the median of those drivers who would have. Default: "none".

        Raises:
            TypeError: threads that are no whole number.
            ValueError: an unknown name, a policy file that is damaged or made for something else, a `gap` for a
                policy that brings its own, patience kept where no network decides, or threads below 0 or too many.
            OSError: the file cannot be read.
        """
        return cls(*policy_named(policy, gap), threads, patience=patience)

    @overload
    def predict(
        self, traffic: Traffic, priorities: Priorities | None = None, *, trajectories: Literal[True] = True
    ) -> Prediction: ...
    @overload
    def predict(
        self, traffic: Traffic, priorities: Priorities | None = None, *, trajectories: Literal[False]
    ) -> Summary: ...

    def predict(
        self, traffic: Traffic, priorities: Priorities | None = None, *, trajectories: bool = True
    ) -> Prediction | Summary:
        """The next 10 s.

        Args:
            traffic: the vehicles now.
            priorities: None (one scenario, no intervention); or (first, second) vehicle ids (one scenario); or
                int8 (scenario, pair), or (pair,) for one scenario, over `traffic.conflicts`: +1 yielder first,
                -1 prioritized first, 0 left to the gap decision. What they imply under the lane order is added.
            trajectories: False returns the `Summary` alone, faster.

        Raises:
            TypeError: no traffic, or priorities of another dtype.
            ValueError: an unknown vehicle, a pair that does not conflict, or an assignment that contradicts
                itself, the lane order, or what a vehicle can still do.
        """
        check_type("traffic", traffic, Traffic)
        assignments = as_assignments(traffic, priorities)
        with naming(traffic.ids):
            bound = self.bound_to(traffic.intersection)
            if not trajectories:
                return Summary(traffic, *bound.summarize(traffic.core, assignments, True))
            results = bound.predict(traffic.core, assignments, True, True)
        position, speed, acceleration, enters, present, *_ = results
        *_, time_loss, minimum_distance, hold, completed, waited, patience = results
        time = np.arange(STEPS + 1, dtype=np.float32) * np.float32(DT)
        return Prediction(
            traffic,
            time,
            position,
            speed,
            acceleration,
            enters.view(np.bool_),
            present.view(np.bool_),
            time_loss,
            minimum_distance,
            hold,
            completed,
            waited,
            patience if bound.keeps_patience(traffic.core) else None,
        )

    def observe(self, traffic: Traffic) -> Observation:
        """What every vehicle sees and decides at this moment, without intervention."""
        check_type("traffic", traffic, Traffic)
        driving, gap, accepts = self.bound_to(traffic.intersection).observe(traffic.core)
        return Observation(driving, gap, accepts.view(np.bool_))

    def bound_to(self, intersection: Intersection) -> _core.Predictor:
        """The core's predictor on this map, kept for the next time."""
        bound = self._bound.get(intersection.checksum)
        if bound is None:
            bound = self._bound[intersection.checksum] = _core.Predictor(
                intersection.core, self.core_policy, self.threads, self.patience
            )
        return bound

    def patience_of(self, traffic: Traffic, levels: ArrayLike = 0.5) -> NDArray[np.float32]:
        """What `Traffic.patience` may hold: (vehicle,), of each vehicle's driver at a level of all it could have.

        A driver has a quantile: it accepts a gap that a larger share of drivers would. Who waits at the start has
        refused what is there, and is one of those drivers who would have.

        Args:
            traffic: the vehicles now.
            levels: above 0 and below 1, one or (vehicle,); 0.5 is the median, uniform random ones are a draw.

        Raises:
            ValueError: no network decides about gaps; or levels of another shape, or out of range.
        """
        check_type("traffic", traffic, Traffic)
        given = np.asarray(levels, np.float64)
        if given.shape not in ((), (len(traffic),)):
            raise ValueError(f"levels must be one number or have shape ({len(traffic)},), not {given.shape}")
        each = np.ascontiguousarray(np.broadcast_to(given, len(traffic)))
        return self.bound_to(traffic.intersection).patience(traffic.core, each)

    def __repr__(self) -> str:
        return f"Predictor({self.name!r})"

    def __reduce__(self) -> tuple[Callable[..., Predictor], tuple[PolicyFile, str, int]]:
        return partial(Predictor, patience=self.patience), (self.policy, self.name, self.threads)


def as_assignments(traffic: Traffic, priorities: Priorities | None) -> NDArray[np.int8]:
    """Priorities in any of their forms as int8 (scenario, pair).

    Raises:
        TypeError, ValueError: as in `Predictor.predict`.
    """
    if priorities is None:
        return np.zeros((1, len(traffic.conflicts)), np.int8)
    if not isinstance(priorities, np.ndarray):
        return traffic.assign(priorities)[None]
    if priorities.dtype != np.int8:
        raise TypeError(f"priorities must be int8, not {priorities.dtype}")
    if priorities.ndim == 1:
        priorities = priorities[None]
    if priorities.ndim != 2 or priorities.shape[1] != len(traffic.conflicts):
        raise ValueError(
            f"priorities must have shape (scenario, {len(traffic.conflicts)}), one column a conflict,"
            f" not {priorities.shape}"
        )
    if ((priorities < -1) | (priorities > 1)).any():
        raise ValueError("priorities must be +1 (yielder first), -1 (prioritized first) or 0")
    return np.ascontiguousarray(priorities)
