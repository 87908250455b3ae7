"""Whether vehicles keep to the rules in predictions: lines at which they are held, assigned orders, gaps to the lead.

Who is held, or goes second, and is able to stop, does stop: at its line, or before its conflict where it stands or
creeps past its line from the start. Exempt is who cannot stop: who is committed at the start, which nobody may put
second, and who creeps so near to its conflict that the hardest braking does not keep it out. Who goes first and waits
for nobody is free to go, once it has made the stop that its line may ask for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from intersection_env import _core
from intersection_env.constants import ACCELERATION, DT
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
    held_past_line: int = 0
    """Vehicles held at the start where they could not stop at their line, but before their first conflict."""
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
            f" {self.held_past_line} held past their line;"
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
    _past_lines(traffic, prediction, where, findings)
    _orders(traffic, assignment, prediction, where, findings)
    _gaps(traffic, prediction, where, findings)


def _stop_lines(traffic: Traffic) -> Floats:
    """(vehicle,) [m]."""
    return np.array([traffic.intersection.routes[route].stop_line for route in traffic.route], np.float64)


def _fronts(traffic: Traffic, prediction: Prediction) -> Floats:
    """(time, vehicle) [m]."""
    return np.asarray(prediction.position[0].astype(np.float64) + traffic.length / 2.0, np.float64)


def _able(traffic: Traffic, prediction: Prediction) -> NDArray[np.bool_]:
    """(time, vehicle): could stop at its line."""
    speed = prediction.speed[0].astype(np.float64)
    to_line = _stop_lines(traffic) - _fronts(traffic, prediction)
    return np.asarray(to_line >= speed**2 / (2.0 * _core.BRAKING), np.bool_)


def _hardest_stop(speed: Floats) -> Floats:
    """The way to a standstill in whole steps [m] at a speed [m/s], by the hardest braking of a network."""
    following = np.maximum(speed - DT * ACCELERATION, 0.0)
    return np.asarray(DT / 2.0 * (speed + following) + following**2 / (2.0 * ACCELERATION), np.float64)


def _lines(traffic: Traffic, prediction: Prediction, where: str, findings: Findings) -> None:
    held = _able(traffic, prediction) & ~prediction.enters[0] & prediction.present[0]
    # once held and able to stop, a vehicle is to stay before its line for as long as it is held
    steps, vehicles = np.nonzero(held[:-1] & ~prediction.enters[0][1:] & prediction.present[0][1:])
    findings.held_steps += len(steps)
    if len(steps):
        beyond = (_fronts(traffic, prediction) - _stop_lines(traffic))[steps + 1, vehicles]
        findings.farthest = max(findings.farthest, float(beyond.max()))
        for step, vehicle in zip(steps[beyond > LINE_TOLERANCE], vehicles[beyond > LINE_TOLERANCE], strict=True):
            findings.wrong.append(f"{where}: vehicle {vehicle} runs its line after step {step}")


def _past_lines(traffic: Traffic, prediction: Prediction, where: str, findings: Findings) -> None:
    front, speed = _fronts(traffic, prediction), prediction.speed[0, 0].astype(np.float64)
    conflict = np.array([traffic.intersection.routes[route].first_conflict for route in traffic.route], np.float64)
    held = prediction.present[0, 0] & ~prediction.enters[0, 0] & ~_able(traffic, prediction)[0]
    held &= conflict - front[0] >= _hardest_stop(speed)
    findings.held_past_line += int(held.sum())
    waits = np.logical_and.accumulate(~prediction.enters[0][:-1])
    enters = (waits & (front[1:] > conflict + LINE_TOLERANCE)).any(axis=0)
    for vehicle in np.flatnonzero(held & enters):
        findings.wrong.append(f"{where}: vehicle {vehicle} is held past its line, and enters its conflict")


def _orders(
    traffic: Traffic, assignment: NDArray[np.int8], prediction: Prediction, where: str, findings: Findings
) -> None:
    seconds = {int(pair[0 if way < 0 else 1]) for pair, way in zip(traffic.conflicts, assignment, strict=True) if way}
    undecided = set(traffic.conflicts[assignment == 0].ravel().tolist())  # may wait for a gap, or for one under way
    conflicts = {(c.yielder, c.prioritized): c for c in traffic.intersection.conflicts}
    for (i, j), way in zip(traffic.conflicts.tolist(), assignment.tolist(), strict=True):
        if way == 0:
            continue
        conflict = conflicts[int(traffic.route[i]), int(traffic.route[j])]
        ends = (i, conflict.on_yielder), (j, conflict.on_prioritized)
        (first, first_interval), (second, second_interval) = ends if way > 0 else ends[::-1]
        open_ = prediction.present[0][:, first] & (prediction.position[0][:, first] < first_interval[1])
        open_ &= prediction.position[0][:, second] - traffic.length[second] / 2.0 < second_interval[1]
        if not open_[0]:
            continue
        findings.assigned_pairs += 1
        while_open = np.logical_and.accumulate(open_)
        _second(traffic, prediction, while_open, (first, second), second_interval[0], where, findings)
        if first not in seconds and first not in undecided:
            findings.free_first += 1
            if not prediction.enters[0][
                prediction.present[0][:, first] & _stop_made(traffic, prediction, first), first
            ].all():
                findings.wrong.append(f"{where}: {first} goes first, and is held")


def _stop_made(traffic: Traffic, prediction: Prediction, vehicle: int) -> NDArray[np.bool_]:
    """(time,): no stop is to be made any more, or none at all."""
    if prediction.waited is None or not traffic.intersection.routes[traffic.route[vehicle]].must_stop:
        return np.ones(len(prediction.time), np.bool_)
    beyond = _fronts(traffic, prediction)[:, vehicle] > _stop_lines(traffic)[vehicle]
    return np.asarray((prediction.waited[0][:, vehicle] > 0) | beyond, np.bool_)


def _second(
    traffic: Traffic,
    prediction: Prediction,
    while_open: NDArray[np.bool_],
    pair: tuple[int, int],
    begin: float,
    where: str,
    findings: Findings,
) -> None:
    """Looks at the second of a pair (first, second), whose conflict begins for it at `begin` [m]."""
    first, second = pair
    front, speed = _fronts(traffic, prediction)[:, second], prediction.speed[0, :1, second].astype(np.float64)
    findings.carried_out += bool(((front >= begin) & ~while_open).any())
    if _able(traffic, prediction)[0, second]:
        if (front[while_open] > _stop_lines(traffic)[second] + LINE_TOLERANCE).any():
            findings.wrong.append(f"{where}: {second} crosses its line before {first} has cleared")
    elif begin - front[0] >= _hardest_stop(speed)[0] and (front[while_open] > begin + LINE_TOLERANCE).any():
        findings.wrong.append(f"{where}: {second}, past its line, enters the conflict before {first} has cleared")


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
