"""Whether vehicles keep to the rules in predictions: lines at which they are held, assigned orders, gaps to the lead.

Who is held, or goes second, and is able to stop, does stop; who goes first and waits for nobody is free to go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import ACCELERATION
from intersection_env.evaluation.moments import Moment
from intersection_env.prediction.maneuvers import crossing_orders
from intersection_env.prediction.predictor import Prediction, Predictor
from intersection_env.traffic import Traffic

LINE_TOLERANCE = 0.05  # [m], by which a stop in whole steps may pass the line: less than v²/2b leaves at 0.4 m/s
LEAST_GAP = 0.5  # [m], to the lead, of whoever can still keep it by braking as hard as an action can
GAP_TOLERANCE = 0.05  # [m]
Floats = NDArray[np.float64]


@dataclass
class Findings:
    """What was looked at, and what was wrong with it."""

    held_steps: int = 0
    assigned_pairs: int = 0
    carried_out: int = 0
    """Assigned pairs in which the second entered the conflict within the horizon, after the first."""
    free_first: int = 0
    followers: int = 0
    farthest: float = -np.inf
    """How far a front came beyond a line that it was held at [m]."""
    nearest: float = np.inf
    """The smallest gap to a lead [m]."""
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.held_steps} held steps, the farthest front {self.farthest:+.3f} m beyond its line;"
            f" {self.assigned_pairs} assigned pairs, {self.carried_out} of them carried out within 10 s,"
            f" {self.free_first} firsts free to go; {self.followers} followers, the smallest gap {self.nearest:.2f} m;"
            f" {len(self.wrong)} findings"
        )


def obedience(predictor: Predictor, moments: Sequence[Moment], seed: int = 0) -> Findings:
    """What predictions from recorded moments show, each under a random crossing order of a random half of the vehicles.

    Raises:
        ValueError: no moments.
    """
    if not moments:
        raise ValueError("no moments to look at obedience from")
    generator, findings = np.random.default_rng(seed), Findings()
    for moment in moments:
        assignment = random_order(moment.traffic, generator)
        where = f"scene {moment.scene.id}, {moment.time:.1f} s"
        look_at(moment.traffic, assignment, predictor.predict(moment.traffic, assignment), where, findings)
    return findings


def random_order(traffic: Traffic, generator: np.random.Generator) -> NDArray[np.int8]:
    """A feasible assignment (pair,) for some of the vehicles; all left to the gap decision if there is none."""
    pairs = len(traffic.conflicts)
    preferred = generator.choice(np.array([-1, 1], np.int8), pairs)
    cooperative = [one for one, takes in zip(traffic.ids, generator.random(len(traffic)) < 0.5, strict=True) if takes]
    first = next(crossing_orders(traffic, cooperative, preferred=preferred, batch=1), None)
    return np.zeros(pairs, np.int8) if first is None else first[0]


def look_at(
    traffic: Traffic, assignment: NDArray[np.int8], prediction: Prediction, where: str, findings: Findings
) -> None:
    """Notes what is wrong with a prediction under an assignment (pair,); `where` names the traffic."""
    _lines(traffic, prediction, where, findings)
    _orders(traffic, assignment, prediction, where, findings)
    _gaps(traffic, prediction, where, findings)


def _to_line(traffic: Traffic, prediction: Prediction) -> Floats:
    """d_stop (time, vehicle)."""
    stop = np.array([traffic.intersection.routes[route].stop_line for route in traffic.route])
    return np.asarray(stop - prediction.position[0] - traffic.length / 2.0, np.float64)


def _lines(traffic: Traffic, prediction: Prediction, where: str, findings: Findings) -> None:
    to_line, speed = _to_line(traffic, prediction), prediction.speed[0].astype(np.float64)
    able = to_line >= np.maximum(speed**2 / (2.0 * _core.BRAKING), 0.0)
    held = able & ~prediction.enters[0] & prediction.present[0]
    # once held and able to stop, a vehicle is to stay before its line for as long as it is held
    steps, vehicles = np.nonzero(held[:-1] & ~prediction.enters[0][1:] & prediction.present[0][1:])
    findings.held_steps += len(steps)
    if len(steps):
        beyond = -to_line[steps + 1, vehicles]
        findings.farthest = max(findings.farthest, float(beyond.max()))
        for step, vehicle in zip(steps[beyond > LINE_TOLERANCE], vehicles[beyond > LINE_TOLERANCE], strict=True):
            findings.wrong.append(f"{where}: vehicle {vehicle} runs its line after step {step}")


def _orders(
    traffic: Traffic, assignment: NDArray[np.int8], prediction: Prediction, where: str, findings: Findings
) -> None:
    to_line, position = _to_line(traffic, prediction), prediction.position[0].astype(np.float64)
    conflicts = {(c.yielder, c.prioritized): c for c in traffic.intersection.conflicts}
    seconds = {int(pair[0 if way < 0 else 1]) for pair, way in zip(traffic.conflicts, assignment, strict=True) if way}
    undecided = set(traffic.conflicts[assignment == 0].ravel().tolist())  # may wait for a gap, or for one under way
    for (i, j), way in zip(traffic.conflicts.tolist(), assignment.tolist(), strict=True):
        if way == 0:
            continue
        conflict = conflicts[int(traffic.route[i]), int(traffic.route[j])]
        intervals = conflict.on_yielder, conflict.on_prioritized
        (first, first_interval), (second, second_interval) = (
            ((i, intervals[0]), (j, intervals[1])) if way > 0 else ((j, intervals[1]), (i, intervals[0]))
        )
        open_ = prediction.present[0][:, first] & (position[:, first] < first_interval[1])
        open_ &= position[:, second] - traffic.length[second] / 2.0 < second_interval[1]
        if to_line[0, second] < prediction.speed[0, 0, second] ** 2 / (2.0 * _core.BRAKING) or not open_[0]:
            continue
        findings.assigned_pairs += 1
        while_open = np.logical_and.accumulate(open_)
        if (to_line[while_open, second] < -LINE_TOLERANCE).any():
            findings.wrong.append(f"{where}: {second} crosses its line before {first} has cleared")
        enters = position[:, second] + traffic.length[second] / 2.0 >= second_interval[0]
        findings.carried_out += bool((enters & ~while_open).any())
        if first not in seconds and first not in undecided:
            findings.free_first += 1
            if not prediction.enters[0][prediction.present[0][:, first], first].all():
                findings.wrong.append(f"{where}: {first} goes first, and is held")


def _gaps(traffic: Traffic, prediction: Prediction, where: str, findings: Findings) -> None:
    position, speed = prediction.position[0].astype(np.float64), prediction.speed[0].astype(np.float64)
    for i in range(len(traffic)):
        for j in np.flatnonzero(traffic.route == traffic.route[i]).tolist():
            gap = position[:, j] - position[:, i] - (traffic.length[i] + traffic.length[j]) / 2.0
            slack = gap[0] + (speed[0, j] ** 2 - speed[0, i] ** 2) / (2.0 * ACCELERATION) - LEAST_GAP
            if i == j or position[0, j] <= position[0, i] or slack < GAP_TOLERANCE:
                continue
            both = prediction.present[0][:, i] & prediction.present[0][:, j]
            both &= ~np.logical_or.accumulate(_another_between(traffic, position, i, j))
            findings.followers += 1
            findings.nearest = min(findings.nearest, float(gap[both].min(initial=np.inf)))
            if (gap[both] < LEAST_GAP - GAP_TOLERANCE).any():
                findings.wrong.append(f"{where}: {i} comes within {gap[both].min():.2f} m of {j}")


def _another_between(traffic: Traffic, position: Floats, i: int, j: int) -> NDArray[np.bool_]:
    """(time,): a third vehicle is beside i or between it and j, as it were, where their lanes are shared.

    The nearest one ahead is the lead, and hides the others: one that collides with i, as it merges beside it or was too
    fast behind it from the start, hides j.
    """

    def comes(along: Floats, k: int) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = (along > position[:, i]) & (along - traffic.length[k] / 2.0 < position[:, j])
        return found

    found = np.zeros(len(position), np.bool_)
    for k in set(np.flatnonzero(traffic.route == traffic.route[i]).tolist()) - {i, j}:
        found |= comes(position[:, k], k)
    for lane in traffic.intersection.shared_lanes:
        for own, other, offset in ((lane.a, lane.b, -lane.offset), (lane.b, lane.a, lane.offset)):
            if own != traffic.route[i]:
                continue
            for k in np.flatnonzero(traffic.route == other).tolist():
                for along in (position[:, k], position[:, k] + offset):
                    found |= comes(along, k)
    return found
