"""SUMO drives on from a recorded moment: by its own right of way, or in an order imposed.

Vehicles begin where and as fast as they were recorded. Who drives each is drawn as `data.sumo.demand` draws the
drivers of the simulated recordings, since a recording doesn't tell; what follows is computed as those were
(`data.sumo.drive`): ballistic steps of 0.04 s, a decision every 0.32 s, impatience after 15 s. Nobody else enters. The
same drivers, with the same seed, drive with and without the order.

What a driver does there who is told an order: signs no longer count. All links have priority, so that nobody halts at
a stop sign, slows down to look, or yields by rule. Who goes second in a pair plans a stop at the end of its lane, as
SUMO plans any stop, and drives on from where it is then as soon as all that go before it have cleared: their centres
have left the conflict, when a pair is no longer active in a prediction (`docs/model.md`, Pairs). Who goes first
ignores those who wait for it. Following, safe speeds, curves and the look at who else is on the junction stay SUMO's,
so that an order is no licence to drive into somebody. Braking for the stop is the driver's own; harder, up to
its hardest (5.5 m/s²), where the order needs it. Who cannot stop even so is never held, but named in `unheld`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.sumo import demand, net_file
from data.sumo import network as sumo_network
from data.sumo.demand import Driver
from data.sumo.drive import SETTINGS
from data.sumo.places import BENDPLATZ
from data.sumo.tracks import FRAME_RATE
from experiments.models.running_sumo import running_sumo
from experiments.models.sumo_vehicles import Motions, follow, lane_at, put
from experiments.models.surviving import surviving
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection
from intersection_env.traffic import Traffic

SUBSTEPS = round(DT * FRAME_RATE)
HARDEST = "emergencyDecel"  # the trait [m/s²]
SPARE = 1.05  # ours: times the braking that just suffices
CHUNK = 20  # jobs that are done again after a crash


class Job(NamedTuple):
    """What to drive: the traffic, its drivers (one a vehicle), SUMO's seed, and under which orders.

    orders: of each run, None for SUMO's right of way or (pair,) int8 over `traffic.conflicts`.
    """

    traffic: Traffic
    drivers: tuple[Driver, ...]
    seed: int
    orders: tuple[NDArray[np.int8] | None, ...]
    steps: int


class Driven(NamedTuple):
    """A run: what was driven, and who (indices) should have waited but could not stop any more."""

    motions: Motions
    unheld: tuple[int, ...]


def drivers_of(traffic: Traffic, kinds: Sequence[str], seed: int, moment: int) -> tuple[Driver, ...]:
    """A driver a vehicle: the same for the same seed, moment and vehicle.

    kinds: (vehicle,) "car", "truck_bus" or "bicycle".

    Raises:
        ValueError: another kind.
    """
    return tuple(
        demand.driver_like(
            np.random.default_rng((seed, moment, i)), str(i), traffic.intersection.routes[traffic.route[i]].id, kind
        )
        for i, kind in enumerate(kinds)
    )


def driven_on(jobs: Sequence[Job]) -> list[list[Driven]]:
    """The runs of each job, made in another process; what a crash takes along is made again.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        ValueError: a traffic that is not on Bendplatz.
        RuntimeError: SUMO crashed again and again at the same place.
    """
    return surviving(_drive, jobs, "jobs", CHUNK)


def _drive(jobs: Sequence[Job]) -> list[list[Driven]]:
    with DriveOn() as sumo:
        return [[sumo.drive(job, order) for order in job.orders] for job in jobs]


class DriveOn:
    """Drives by libsumo, while the context lasts; one at a time in a process."""

    def __init__(self) -> None:
        """Prepares the network; SUMO starts with the context."""
        self._intersection = Intersection.load(BENDPLATZ.map)
        _, self._network = sumo_network.read()

    def __enter__(self) -> DriveOn:
        """Starts SUMO.

        Raises:
            ModuleNotFoundError: libsumo is not installed.
            RuntimeError: libsumo is already running in this process.
        """
        self._running = ExitStack()
        self._sumo = self._running.enter_context(running_sumo(self._command))
        return self

    def __exit__(self, *_: object) -> None:
        """Ends SUMO."""
        self._running.close()

    def _command(self, folder: Path) -> list[str]:
        self._files = {name: folder / f"{name}.xml" for name in ("signs", "order", "drivers")}
        net_file.write(self._network, self._files["signs"])
        net_file.write(sumo_network.without_signs(self._network), self._files["order"])
        return ["sumo", "--net-file", str(self._files["signs"]), "--no-step-log"]

    def drive(self, job: Job, order: NDArray[np.int8] | None) -> Driven:
        """One run: the same for the same job and order, whatever was driven before.

        Raises:
            ValueError: traffic on another map.
        """
        traffic = job.traffic
        if traffic.intersection != self._intersection:
            raise ValueError(f"traffic is on {traffic.intersection}, SUMO on {self._intersection}")
        demand.write(list(job.drivers), self._network.route_edges, self._files["drivers"], depart=False)
        net = self._files["signs" if order is None else "order"]
        sumo, files = self._sumo, ("--net-file", str(net), "--route-files", str(self._files["drivers"]))
        sumo.load([*files, *SETTINGS, "--seed", str(job.seed), "--collision.action", "none"])
        put(sumo, self._network, traffic, [f"t{driver.id}" for driver in job.drivers])
        holds = Holds(sumo, self._network, job, order)

        def advance(position: NDArray[np.float32]) -> None:
            holds.release(position)
            for _ in range(SUBSTEPS):
                sumo.simulationStep()

        return Driven(follow(sumo, self._network, traffic, job.steps, advance), tuple(sorted(holds.unheld)))


class Holds:
    """Who waits at its line for whom."""

    def __init__(self, sumo: Any, network: sumo_network.Network, job: Job, order: NDArray[np.int8] | None) -> None:
        """Holds all that go second; without an order nobody."""
        self._sumo, self._network, self._job = sumo, network, job
        self._foes: dict[int, list[tuple[int, float]]] = {}
        """Of each held vehicle: who goes before it, and where that one's centre has cleared [m]."""
        self.unheld: set[int] = set()
        for first, second, cleared in [] if order is None else _firsts(job.traffic, order):
            self._foes.setdefault(second, []).append((first, cleared))
        for vehicle in [one for one in self._foes if not self._hold(one)]:
            self.unheld.add(vehicle)
            del self._foes[vehicle]
        self._let_pass()

    def release(self, position: NDArray[np.float32]) -> None:
        """Lets those drive on whose foes have all cleared: position (vehicle,) [m]."""
        free = [one for one, foes in self._foes.items() if all(position[foe] >= cleared for foe, cleared in foes)]
        vehicle = self._sumo.vehicle
        for one in free:
            id = str(one)
            vehicle.setDecel(id, self._job.drivers[one].traits["decel"])
            vehicle.setSpeed(id, -1.0)
            if vehicle.isStopped(id):
                vehicle.resume(id)
            elif vehicle.getStops(id):
                vehicle.replaceStop(id, 0, "")
            del self._foes[one]

    def _let_pass(self) -> None:
        """Has everybody ignore those who wait for it: some stand where SUMO's junction has begun, before their line."""
        waiting: dict[int, list[str]] = {}
        for one, foes in self._foes.items():
            for foe, _ in foes:
                waiting.setdefault(foe, []).append(str(one))
        for foe, ids in waiting.items():
            self._sumo.vehicle.setParameter(str(foe), "junctionModel.ignoreIDs", " ".join(ids))

    def _hold(self, one: int) -> bool:
        """Tells a vehicle to stop at its line; whether it still can."""
        traffic, traits, vehicle = self._job.traffic, self._job.drivers[one].traits, self._sumo.vehicle
        route = traffic.intersection.routes[traffic.route[one]]
        front, speed = float(traffic.position[one] + 0.5 * traffic.length[one]), float(traffic.speed[one])
        lane, begin, scale = lane_at(self._network, route.id, route.stop_line - sumo_network.STANDOFF - 0.01)
        length = self._sumo.lane.getLength(lane)
        left = begin + scale * length - front
        if left < 0.01 and speed < 1.0:  # creeps in front of its line, or behind
            vehicle.setSpeed(str(one), 0.0)
            return True
        needed = SPARE * 0.5 * speed**2 / max(left, 0.01)
        if left < 0.01 or needed > traits[HARDEST]:
            return False
        if needed > traits["decel"]:
            vehicle.setDecel(str(one), needed)
        vehicle.setStop(str(one), self._sumo.lane.getEdgeID(lane), pos=length)
        return True


def _firsts(traffic: Traffic, order: NDArray[np.int8]) -> list[tuple[int, int, float]]:
    """(first, second, where the first's centre has cleared) of every assigned pair."""
    by_routes = {(one.yielder, one.prioritized): one for one in traffic.intersection.conflicts}
    found = []
    for (i, j), way in zip(traffic.conflicts.tolist(), order.tolist(), strict=True):
        conflict = by_routes[int(traffic.route[i]), int(traffic.route[j])]
        if way > 0:
            found.append((i, j, conflict.on_yielder[1]))
        elif way < 0:
            found.append((j, i, conflict.on_prioritized[1]))
    return found
