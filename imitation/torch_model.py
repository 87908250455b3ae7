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
from torch.nn.functional import logsigmoid

from imitation.map_tables import MapTables
from imitation.torch_networks import Networks, View
from intersection_env import Traffic, _core
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE, STEPS
from intersection_env.policies.file import PolicyFile


class Vehicles(NamedTuple):
    """The traffic of some moments side by side, as the core knows it at the start.

    route: (moment, vehicle) places in the tables. position, speed, half_length, max_speed: (moment, vehicle) [m],
    [m/s]. present, delta: (moment, vehicle) bool. i, j: (moment, pair) indices of yielders and of who has priority.
    Smaller moments are filled up with vehicles that are not present, and with pairs of a spare one, the last, which is
    present in none.
    """

    route: Tensor
    position: Tensor
    speed: Tensor
    half_length: Tensor
    max_speed: Tensor
    present: Tensor
    delta: Tensor
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


class TorchPredictor:
    """Both networks, bound to the traffic of some moments."""

    def __init__(self, tables: MapTables, vehicles: Vehicles, networks: Networks) -> None:
        self.tables, self.vehicles, self.networks = tables, vehicles, networks
        route = vehicles.route
        self.stop_line, self.length = tables.stop_line[route], tables.length[route]
        own, other = route[:, :, None], route[:, None, :]
        self.split, self.merge, self.offset = (
            table[own, other] for table in (tables.split, tables.merge, tables.offset)
        )
        self.half_lengths = vehicles.half_length[:, :, None] + vehicles.half_length[:, None, :]
        lane = tables.stop_lane[route]
        self.same_lane = lane[:, :, None] == lane[:, None, :]
        yielder, prioritized = route.gather(1, vehicles.i), route.gather(1, vehicles.j)
        self.end_i, self.end_j = tables.own_end[yielder, prioritized], tables.own_end[prioritized, yielder]
        self.yielder_number = tables.number[yielder]

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

    def states(self, assignment: Tensor, learns_gaps: bool = False) -> Iterator[State]:
        """The next 10 s step by step, as of `predict`; with gradients, where the networks have any.

        learns_gaps: let gradients reach the gap network too, as if accelerations changed with the probability of
            accepting all gaps, from that of waiting to that of going.
        """
        known, tables = self.vehicles, self.tables
        shape = (len(assignment), known.route.shape[1])
        route, number, route_count = (
            one.expand(shape) for one in (known.route, tables.number[known.route], tables.route_count[known.route])
        )
        i, j = known.i.expand(assignment.shape), known.j.expand(assignment.shape)
        position, speed = known.position.expand(shape), known.speed.expand(shape)
        delta, hold = known.delta.expand(shape), torch.full(shape, -1)
        present, lost, asked = known.present.expand(shape), torch.zeros(shape), torch.zeros(())
        of_vehicle = torch.zeros(shape)
        for _ in range(STEPS):
            front, rear = position + known.half_length, position - known.half_length
            to_line = self.stop_line - front
            limit, headings = tables.road(route, position)
            v_max = torch.minimum(limit, known.max_speed)
            lead, to_lead, lead_speed = self._leads(position, front, rear, speed, present)
            # who is told to wait, and who waits
            active = self._active(assignment, position, rear, present)
            open_ = active & (assignment == 0) & (hold.gather(1, j) <= self.yielder_number)
            # in the order of `Gap`
            seen = (self.end_i - rear.gather(1, i), speed.gather(1, i), to_line.gather(1, j), speed.gather(1, j))
            logit = self.networks.gap(torch.stack(seen, -1).detach())
            refused = open_ & (logit <= 0.0)

            def some(flags: Tensor, index: Tensor) -> Tensor:
                return of_vehicle.scatter_add(1, index, flags.float()) > 0

            told = some(active & (assignment < 0), i) | some(active & (assignment > 0), j)
            waits = told | some(refused, i)
            braking = speed.square() / (2.0 * _core.BRAKING)
            settled = delta & (to_line < braking)
            kept = some(active & (assignment == 0) & settled.gather(1, i) & ~delta.gather(1, j), j)
            delta = ~(waits | kept) | settled
            own = torch.where(delta | ~waits, -1, torch.where(told, route_count, number))
            queues = (to_lead < LEAD_RANGE) & self._queues_with(lead) & (to_line >= 0.0)
            hold = torch.maximum(own, torch.where(queues, hold.gather(1, lead), -1))
            asked = asked + open_.sum()
            # drive and advance
            view = View(to_line, speed, v_max, headings, to_lead, lead_speed)
            acceleration = self.networks.drive(view, delta, max_speed=known.max_speed)
            if learns_gaps:
                undecided = ~(told | kept | settled)
                accepts = of_vehicle.scatter_add(1, i, torch.where(open_, logsigmoid(logit), 0.0)).exp()
                with torch.no_grad():
                    otherwise = self.networks.drive(view, ~delta, max_speed=known.max_speed) - acceleration
                    gained = torch.where(undecided, torch.where(delta, -otherwise, otherwise), 0.0)
                acceleration = acceleration + gained * (accepts - accepts.detach())
            lost = lost + torch.where(present, DT * (1.0 - speed / v_max), 0.0)
            faster = (speed + DT * acceleration).clamp(min=0.0)
            applied = torch.where(present, (faster - speed) / DT, 0.0)
            position = torch.where(present, position + 0.5 * DT * (speed + faster), position)
            speed = torch.where(present, faster, speed)
            present = present & (position < self.length)
            yield State(position, speed, applied, present, lost, asked)

    def _queues_with(self, lead: Tensor) -> Tensor:
        """Whether the lead (moment, vehicle) stops in the same lane."""
        same = self.same_lane.expand(len(lead), -1, -1)
        return same.gather(2, lead.unsqueeze(-1)).squeeze(-1)

    def _leads(
        self, position: Tensor, front: Tensor, rear: Tensor, speed: Tensor, present: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Each vehicle's lead, the distance to it [m] and its speed [m/s]."""
        ahead = position[:, None, :] - self.offset - position[:, :, None]
        before_split = (rear[:, :, None] < self.split) & (rear[:, None, :] < self.split)
        leads = present[:, None, :] & (ahead > 0.0) & (before_split | (front[:, None, :] > self.merge))
        gap, lead = torch.where(leads, ahead - self.half_lengths, torch.inf).min(-1)
        near = gap <= LEAD_RANGE
        return lead, torch.where(near, gap, LEAD_RANGE), torch.where(near, speed.gather(1, lead), FREE_LEAD_SPEED)

    def _active(self, assignment: Tensor, position: Tensor, rear: Tensor, present: Tensor) -> Tensor:
        i, j = self.vehicles.i.expand(assignment.shape), self.vehicles.j.expand(assignment.shape)
        yielder_second = (rear.gather(1, i) < self.end_i) & (position.gather(1, j) < self.end_j)
        yielder_first = (rear.gather(1, j) < self.end_j) & (position.gather(1, i) < self.end_i)
        both = present.gather(1, i) & present.gather(1, j)
        return both & torch.where(assignment > 0, yielder_first, yielder_second)
