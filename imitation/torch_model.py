"""The predictor once more as plain torch operations, vectorised over moments or scenarios, vehicles and pairs.

It does what `docs/model.md` says under "The model", with both networks: the one copy of the core in which torch sees
every operation, for models with one thing changed, as a peer to time, and for gradients. What the core knows already it
reads from there: maps, pairs, memories at the start. `tests/imitation/test_torch_model.py` holds it to the core.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from imitation.map_tables import MapTables
from imitation.torch_networks import Networks, View
from intersection_env import Traffic, _core
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE, STEPS
from intersection_env.policies.file import PolicyFile


class Vehicles(NamedTuple):
    """The traffic of some moments side by side, as the core knows it at the start.

    route: (moment, vehicle) places in the tables. position, speed, half_length, max_speed: (moment, vehicle) [m],
    [m/s]. present, delta, stopped: (moment, vehicle) bool; stopped: at its line, before now. i, j: (moment, pair)
    indices of yielders and of who has priority. Smaller moments are filled up with vehicles that are not present, and
    with pairs of a spare one, the last, which is present in none.
    """

    route: Tensor
    position: Tensor
    speed: Tensor
    half_length: Tensor
    max_speed: Tensor
    present: Tensor
    delta: Tensor
    stopped: Tensor
    i: Tensor
    j: Tensor

    @classmethod
    def of(cls, tables: MapTables, moments: Sequence[Traffic], spare: bool = True) -> Vehicles:
        """The vehicles of these moments, all on maps that the tables know; a single moment can do without a spare."""
        most = max(len(one) for one in moments)
        pairs = max(len(one.conflicts) for one in moments)

        def rows(of_each: Sequence[NDArray[Any]], fill: float, width: int = most + spare) -> Tensor:
            filled = np.full((len(of_each), width), fill, of_each[0].dtype)
            for row, one in zip(filled, of_each, strict=True):
                row[: len(one)] = one
            return torch.from_numpy(filled)

        begins = [tables.begin[one.intersection.checksum] for one in moments]
        route = rows([one.route.astype(np.int64) + begin for one, begin in zip(moments, begins, strict=True)], 0)
        there = rows([np.ones(len(one), np.bool_) for one in moments], 0)
        position = rows([one.position for one in moments], 0.0)
        return cls(
            route,
            position,
            speed=rows([one.speed for one in moments], 0.0),
            half_length=0.5 * rows([one.length for one in moments], 1.0),
            max_speed=rows([one.max_speed for one in moments], np.inf),
            present=there & (position < tables.length[route]),
            delta=rows([_core.committed(one.intersection.core, one.core) for one in moments], 0),
            stopped=rows([_has_stopped(one) for one in moments], 0),
            i=rows([one.conflicts[:, 0].astype(np.int64) for one in moments], most, pairs),
            j=rows([one.conflicts[:, 1].astype(np.int64) for one in moments], most, pairs),
        )


class State(NamedTuple):
    """All moments, or scenarios of one moment, after a step.

    position: (moment, vehicle) [m]. speed: (moment, vehicle) [m/s]. acceleration: (moment, vehicle) of that step
    [m/s²]. present: (moment, vehicle) bool, on the map. time_loss: (moment, vehicle) until now [s]. asked: how many
    gaps of all moments, pairs and steps were left to the gap network until now.
    """

    position: Tensor
    speed: Tensor
    acceleration: Tensor
    present: Tensor
    time_loss: Tensor
    asked: Tensor


class Seen(NamedTuple):
    """What vehicles see but for their decisions, their rear bumpers [m], who drives or is in its first conflict (bool),
    who leads each, and by how much further along its own route that one is than where they share a lane [m]:
    (..., vehicle)."""

    view: View
    rear: Tensor
    goes_on: Tensor
    lead: Tensor
    further: Tensor


class Pairs(NamedTuple):
    """What pairs are to each other, whoever is held.

    i, j: (..., pair) vehicles. free: (..., pair) bool, active and not assigned. gap: (..., pair, 4), what the gap
    network sees. told, settled, kept, stops: (..., vehicle) bool, as in `docs/model.md`; stops: has yet to stop.
    """

    i: Tensor
    j: Tensor
    free: Tensor
    gap: Tensor
    told: Tensor
    settled: Tensor
    kept: Tensor
    stops: Tensor


class Held(NamedTuple):
    """Who is held, and by what.

    open: (..., pair) bool, whose gap counts. logit: (..., pair), of accepting it. waits: (..., vehicle) bool, told to
    or refused.
    """

    open: Tensor
    logit: Tensor
    waits: Tensor


class TorchPredictor:
    """Both networks, bound to the traffic of some moments."""

    def __init__(self, tables: MapTables, vehicles: Vehicles, networks: Networks) -> None:
        self.tables, self.vehicles, self.networks = tables, vehicles, networks
        route = vehicles.route
        self.stop_line, self.length = tables.stop_line[route], tables.length[route]
        self.must_stop, self.first_conflict = tables.must_stop[route], tables.first_conflict[route]
        own, other = route[:, :, None], route[:, None, :]
        self.lane_begin, self.lane_end, self.offset = (
            table[own, other].movedim(-1, 0) for table in (tables.lane_begin, tables.lane_end, tables.offset)
        )
        self.half_lengths = vehicles.half_length[:, :, None] + vehicles.half_length[:, None, :]
        lane = tables.stop_lane[route]
        self.same_lane = lane[:, :, None] == lane[:, None, :]
        yielder, prioritized = route.gather(1, vehicles.i), route.gather(1, vehicles.j)
        self.end_i, self.end_j = (
            table[1, yielder, prioritized] for table in (tables.on_yielder, tables.on_prioritized)
        )
        self.beyond_line = tables.beyond_line[yielder, prioritized]
        self.yielder_rank = tables.rank[yielder]

    @classmethod
    def of(cls, traffic: Traffic, policy: PolicyFile) -> TorchPredictor:
        """A policy with both networks, bound to one moment, for scenarios of it."""
        tables = MapTables.of([traffic.intersection])
        return cls(tables, Vehicles.of(tables, [traffic], spare=False), Networks.of(policy))

    @torch.inference_mode()
    def predict(self, assignment: Tensor) -> State:
        """How it is after 10 s, under int8 assignments (moment, pair), completed already; or (scenario, pair)."""
        *_, last = self.states(assignment)
        return last

    def states(self, assignment: Tensor) -> Iterator[State]:
        """The next 10 s step by step, as of `predict`; with gradients, where the networks have any."""
        known = self.vehicles
        shape = (len(assignment), known.route.shape[1])
        position, speed, delta = (one.expand(shape) for one in (known.position, known.speed, known.delta))
        hold, present = torch.full(shape, -1), known.present.expand(shape)
        lost, asked = torch.zeros(shape), torch.zeros(())
        stopped = known.stopped.expand(shape)
        for _ in range(STEPS):
            seen = self.seen(position, speed, present)
            stopped = stopped | self.at_stop(seen)
            pairs = self.pairs(assignment, seen, position, present, delta, stopped)
            held = self.held(pairs, self.networks.gap(pairs.gap), hold)
            delta = ~(held.waits | pairs.kept) | pairs.settled
            hold = self.next_hold(seen, pairs, held, delta, hold)
            asked = asked + held.open.sum()
            acceleration = self._acceleration(seen, pairs, held, delta)
            lost = lost + torch.where(present, DT * (1.0 - speed / seen.view.v_max), 0.0)
            faster = (speed + DT * acceleration).clamp(min=0.0)
            applied = torch.where(present, (faster - speed) / DT, 0.0)
            position = torch.where(present, position + 0.5 * DT * (speed + faster), position)
            speed = torch.where(present, faster, speed)
            present = present & (position < self.length)
            yield State(position, speed, applied, present, lost, asked)

    def _acceleration(self, seen: Seen, pairs: Pairs, held: Held, delta: Tensor) -> Tensor:
        """(..., vehicle) [m/s²]."""
        return self.networks.drive(seen.view, delta, max_speed=self.vehicles.max_speed)

    def seen(self, position: Tensor, speed: Tensor, present: Tensor) -> Seen:
        """What all vehicles see at some positions (..., vehicle), but for their decisions."""
        half = self.vehicles.half_length
        front, rear = position + half, position - half
        limit, headings = self.tables.road(self.vehicles.route.expand(position.shape), position)
        lead, further, to_lead, lead_speed = self._leads(position, front, rear, speed, present)
        v_max = torch.minimum(limit, self.vehicles.max_speed)
        view = View(self.stop_line - front, speed, v_max, headings, to_lead, lead_speed)
        return Seen(view, rear, (speed >= _core.DRIVES) | (front > self.first_conflict), lead, further)

    def at_stop(self, seen: Seen) -> Tensor:
        """(..., vehicle) bool: who makes the stop that its line asks for."""
        return self.must_stop & (seen.view.speed < _core.STOPPED) & (seen.view.to_line < _core.AT_LINE)

    def pairs(
        self, assignment: Tensor, seen: Seen, position: Tensor, present: Tensor, delta: Tensor, stopped: Tensor
    ) -> Pairs:
        """What the pairs are to each other; delta (..., vehicle) as remembered, stopped with this step included."""
        view, shape = seen.view, (*position.shape[:-1], assignment.shape[-1])
        i, j = self.vehicles.i.expand(shape), self.vehicles.j.expand(shape)
        active = self._active(assignment, position, seen.rear, present, i, j)
        # in the order of `Gap`
        gap = (
            self.end_i - seen.rear.gather(-1, i),
            view.speed.gather(-1, i),
            view.to_line.gather(-1, j) + self.beyond_line,
            view.speed.gather(-1, j),
        )
        settled = delta & seen.goes_on & (view.to_line < view.speed.square() / (2.0 * _core.BRAKING))
        told = _some(active & (assignment < 0), i, settled) | _some(active & (assignment > 0), j, settled)
        free = active & (assignment == 0)
        kept = _some(free & settled.gather(-1, i) & ~delta.gather(-1, j), j, settled)
        stops = self.must_stop & ~stopped & (view.to_line >= 0.0)
        return Pairs(i, j, free, torch.stack(gap, -1).detach(), told, settled, kept, stops)

    def held(self, pairs: Pairs, logit: Tensor, hold: Tensor) -> Held:
        """Whose gaps count, as the foe is not held itself, and who waits.

        logit: (..., pair), of accepting the gap. hold: (..., vehicle), as remembered.
        """
        open_ = pairs.free & (hold.gather(-1, pairs.j) <= self.yielder_rank)
        refused = _some(open_ & (logit <= 0.0), pairs.i, pairs.told)
        return Held(open_, logit, pairs.told | pairs.stops | refused)

    def next_hold(self, seen: Seen, pairs: Pairs, held: Held, delta: Tensor, hold: Tensor) -> Tensor:
        """Whom each vehicle holds up from now on, itself or through its queue."""
        route = self.vehicles.route
        mine = torch.where(pairs.told, self.tables.route_count[route], self.tables.rank[route])
        own = torch.where(delta | ~held.waits, -1, mine)
        same = self.same_lane.expand(*hold.shape, -1).gather(-1, seen.lead.unsqueeze(-1)).squeeze(-1)
        in_queue = (seen.view.to_line >= 0.0) | ~seen.goes_on
        queues = (seen.view.to_lead < LEAD_RANGE) & same & in_queue
        return torch.maximum(own, torch.where(queues, hold.gather(-1, seen.lead), -1))

    def _leads(
        self, position: Tensor, front: Tensor, rear: Tensor, speed: Tensor, present: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Each vehicle's lead, by how much further that one is along its own route, the distance to it [m] and its
        speed [m/s]."""
        found = []
        for begin, end, offset in zip(self.lane_begin, self.lane_end, self.offset, strict=True):
            ahead = position[..., None, :] - offset - position[..., :, None]
            before_end = (rear[..., :, None] < end) & (rear[..., None, :] - offset < end)
            leads = present[..., None, :] & (ahead > 0.0) & before_end & (front[..., None, :] > begin)
            gap, lead = torch.where(leads, ahead - self.half_lengths, torch.inf).min(-1)
            further = offset.expand_as(ahead).gather(-1, lead.unsqueeze(-1)).squeeze(-1)
            found.append((gap, lead, further))
        gap, lead, further = found[0]
        for other in found[1:]:
            nearer = other[0] < gap
            gap, lead, further = (torch.where(nearer, a, b) for a, b in zip(other, (gap, lead, further), strict=True))
        near = gap <= LEAD_RANGE
        return (
            lead,
            further,
            torch.where(near, gap, LEAD_RANGE),
            torch.where(near, speed.gather(-1, lead), FREE_LEAD_SPEED),
        )

    def _active(
        self, assignment: Tensor, position: Tensor, rear: Tensor, present: Tensor, i: Tensor, j: Tensor
    ) -> Tensor:
        yielder_second = (rear.gather(-1, i) < self.end_i) & (position.gather(-1, j) < self.end_j)
        yielder_first = (rear.gather(-1, j) < self.end_j) & (position.gather(-1, i) < self.end_i)
        both = present.gather(-1, i) & present.gather(-1, j)
        return both & torch.where(assignment > 0, yielder_first, yielder_second)


def _has_stopped(traffic: Traffic) -> NDArray[np.bool_]:
    return np.zeros(len(traffic), np.bool_) if traffic.waited is None else traffic.waited > 0


def _some(flags: Tensor, index: Tensor, like: Tensor) -> Tensor:
    """(..., vehicle) bool: whether any of the pairs (..., pair) of a vehicle by this index has the flag."""
    return torch.zeros(like.shape).scatter_add(-1, index, flags.float()) > 0
