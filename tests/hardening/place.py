"""Whether traffic on a map of one's own drives as it should: nobody stays for ever, rules are kept, core equals twin.

`python -m tests.hardening.place MAP... --traffics 1000`, of names, map sources (.json) or compiled maps (.map).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from intersection_env import Intersection, Predictor, Traffic
from intersection_env.evaluation.obedience import Findings, look_at
from intersection_env.features import Driving
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import DEFAULT
from tests.hardening.obedience import PAST_LINE
from tests.reference.traffic import Traffic as TwinTraffic
from tests.support.core_and_twin import core_predictor, replayed, weights
from tests.support.random_traffic import random_traffic
from tests.support.twins import as_traffic, random_assignment, random_networks, rounded, twin_of

DRIVERS = ("idm", DEFAULT)
LONGEST = 300  # [s]: a dozen vehicles that pass one after the other are gone by then
MOST = 12  # vehicles
HARDEST = 8.0  # [m/s²], the IDM's; networks brake by 6 at most


@dataclass
class Looked:
    """What random traffics on one map show; `wrong` tells of each that is not as it should be."""

    intersection: Intersection
    traffics: int = 0
    longest: dict[str, int] = field(default_factory=lambda: dict.fromkeys(DRIVERS, 0))
    """By driver, until the last vehicle of a traffic has left its route [s]."""
    stay: dict[str, int] = field(default_factory=lambda: dict.fromkeys(DRIVERS, 0))
    """By driver, the traffics in which somebody never does."""
    crashed: dict[str, int] = field(default_factory=lambda: dict.fromkeys(DRIVERS, 0))
    """By driver, those in which it does because it collided, as random traffic may begin too fast behind a lead."""
    compared: int = 0
    farthest: float = 0.0
    """How far a position of the core is from the twin's at most [m]."""
    obedience: Findings = field(default_factory=Findings)
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        conflicts = len(self.intersection.conflicts)
        empty = ", ".join(
            f"{name} {self.stay[name]} (and {self.crashed[name]} after a crash; the others empty after"
            f" {self.longest[name]} s)"
            for name in DRIVERS
        )
        return (
            f"{self.intersection.name}: {len(self.intersection.routes)} routes, {conflicts} conflicts,"
            f" {self.traffics} traffics\n  somebody stays for ever: {empty}\n  obedience: {self.obedience}\n"
            f"  core and twin: {self.compared} compared, at most {1e3 * self.farthest:.2f} mm apart"
        )


def look_at_place(intersection: Intersection, traffics: int, policy: str = DEFAULT, twins: int | None = None) -> Looked:
    """Looks at random traffics on a map under random orders; the first `twins` of them (None: all) beside the twin."""
    looked, predictor = Looked(intersection), Predictor.load(policy)
    drivers = {name: Predictor.load(name) for name in DRIVERS}
    for seed in range(traffics):
        generator, where = np.random.default_rng(seed), f"{intersection.name}, seed {seed}"
        vehicles = int(generator.integers(2, MOST + 1))
        twin = rounded(random_traffic(twin_of(intersection), generator, vehicles, PAST_LINE))
        traffic = as_traffic(intersection, twin)
        looked.traffics += 1
        _drive_on(traffic, drivers, where, looked)
        assignment = random_assignment(traffic, generator)
        look_at(traffic, assignment[0], predictor.predict(traffic, assignment), where, looked.obedience)
        if twins is None or seed < twins:
            _compare(traffic, twin, seed, where, looked)
    looked.wrong += looked.obedience.wrong
    return looked


def _drive_on(traffic: Traffic, drivers: dict[str, Predictor], where: str, looked: Looked) -> None:
    """Predicts on until everybody has left."""
    for name, predictor in drivers.items():
        left, seconds = traffic, 0
        while len(left) and seconds < LONGEST:
            left, seconds = predictor.predict(left).traffic_at(10.0), seconds + 10
        if len(left) and collided(traffic, predictor, seconds) & set(left.ids):
            looked.crashed[name] += 1
        elif len(left):
            looked.stay[name] += 1
            routes = [traffic.intersection.routes[route] for route in left.route]
            places = ", ".join(
                f"{id} ({route.id}, {position + length / 2 - route.stop_line:+.1f} m from its line, {speed:.1f} m/s)"
                for id, route, position, length, speed in zip(
                    left.ids, routes, left.position, left.length, left.speed, strict=True
                )
            )
            looked.wrong.append(f"{where}: by {name} still there after {LONGEST} s: {places}")
        else:
            looked.longest[name] = max(looked.longest[name], seconds)


def collided(traffic: Traffic, predictor: Predictor, seconds: int) -> set[str]:
    """Who overlaps another at some time of so many seconds, though it may have come free again.

    Or, too fast to stop behind its lead at the start, comes to stand beside it: where lanes part, bodies may miss.
    """
    found: set[str] = set()
    seen = predictor.observe(traffic).driving
    way = seen[:, Driving.LEAD_DISTANCE] + seen[:, Driving.LEAD_SPEED] ** 2 / (2.0 * HARDEST)
    too_fast = set(np.array(traffic.ids)[seen[:, Driving.SPEED] ** 2 / (2.0 * HARDEST) > way].tolist())
    for _ in range(seconds // 10):
        prediction = predictor.predict(traffic)
        for time in prediction.time[1:]:
            state = prediction.traffic_at(float(time))
            seen = predictor.observe(state).driving
            stand = (seen[:, Driving.SPEED] == 0.0) & (seen[:, Driving.LEAD_SPEED] == 0.0)
            beside = stand & (seen[:, Driving.LEAD_DISTANCE] < 0.0)
            found.update(*state.overlaps, too_fast & set(np.array(state.ids)[beside].tolist()))
        traffic = prediction.traffic_at(10.0)
    return found


def _compare(traffic: Traffic, twin: TwinTraffic, seed: int, where: str, looked: Looked) -> None:
    """Core and twin under a random order; rules and random networks take turns."""
    generator = np.random.default_rng(10_000_000 + seed)
    assignment = random_assignment(traffic, generator)
    gap, driving = random_networks(generator)
    policy, how = PolicyFile("critical_gap", "idm"), {"gap": "critical_gap", "driver": "idm"}
    if seed % 2:
        policy = PolicyFile("network", "network", weights(gap), weights(driving))
        how = {"gap": "network", "driver": "network", "gap_network": gap, "driver_network": driving}  # type: ignore[dict-item]
    looked.compared += 1
    try:
        creep = policy.driver == "network"
        difference = replayed(traffic, twin, core_predictor(traffic, policy), assignment, creep, **how)
        looked.farthest = max(looked.farthest, difference)
    except AssertionError as error:
        looked.wrong.append(f"{where}: the core is not its twin: {' '.join(str(error).split())[:200]}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Looks at each map; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.hardening.place", description=__doc__.splitlines()[0])
    parser.add_argument("maps", nargs="+", help="names of maps that ship, or files (.json, .map)")
    parser.add_argument("--traffics", type=int, default=1000)
    parser.add_argument("--policy", default=DEFAULT, help="whose obedience is looked at")
    parser.add_argument("--twins", type=int, help="so many of them beside the twin, which is slow; all by default")
    options = parser.parse_args(arguments)
    wrong = 0
    for name in options.maps:
        looked = look_at_place(Intersection.load(name), options.traffics, options.policy, options.twins)
        print(looked, *(f"  {line}" for line in looked.wrong[:20]), sep="\n", flush=True)
        wrong += len(looked.wrong)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
