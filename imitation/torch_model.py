"""The predictor once more as plain torch operations, vectorised over scenarios, vehicles and pairs.

It does what `docs/model.md` says under "The model", with both networks: the one copy of the core in which torch sees
every operation, for models with one thing changed, as a peer to time, and, without `inference_mode`, for gradients.
`tests/imitation/test_torch_model.py` holds it to the core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from intersection_env import Traffic, _core
from intersection_env.constants import DT, FREE_LEAD_SPEED, LEAD_RANGE, STEPS
from intersection_env.maps.intersection import Sample
from intersection_env.policies.file import NetworkWeights, PolicyFile

LEAST_LEAD_GAP, ROUNDED_STOP = 0.5, 0.02  # [m], of what limits a network


class State(NamedTuple):
    """All scenarios after a step.

    position: (scenario, vehicle) [m]. speed: (scenario, vehicle) [m/s]. present: (scenario, vehicle) bool, on the map.
    time_loss: (scenario, vehicle) until now [s]. asked: how many gaps of all scenarios, pairs and steps were left to
    the gap network until now.
    """

    position: Tensor
    speed: Tensor
    present: Tensor
    time_loss: Tensor
    asked: Tensor


class TorchPredictor:
    """A policy with both networks, bound to one traffic."""

    def __init__(self, traffic: Traffic, policy: PolicyFile) -> None:
        assert policy.gap_network is not None
        assert policy.driving_network is not None
        self.gap = _network(policy.gap_network, torch.nn.functional.leaky_relu)  # slope 0.01
        self.driving = _network(policy.driving_network, torch.tanh)
        self.scale = policy.acceleration_scale
        map_ = traffic.intersection.core
        self.position, self.speed, length, self.max_speed = (
            torch.from_numpy(array.copy())
            for array in (traffic.position, traffic.speed, traffic.length, traffic.max_speed)
        )
        self.half = 0.5 * length
        self.route = torch.from_numpy(traffic.route.astype(np.int64))
        self.delta = torch.from_numpy(_core.committed(map_, traffic.core).copy())
        self._set_roads(map_)
        self._set_leads(map_)
        self._set_pairs(map_, torch.from_numpy(traffic.conflicts.astype(np.int64)))

    def _set_roads(self, map_: _core.Map) -> None:
        self.routes, self.inverse_spacing = len(map_.routes), 1.0 / map_.spacing
        self.stop_line = torch.tensor([map_.routes[route].stop_line for route in self.route])
        self.length = torch.tensor([map_.routes[route].length for route in self.route])
        rows = [map_.routes[route].sample_count for route in self.route]
        self.first = torch.tensor([0, *np.cumsum(rows)[:-1]])
        self.last = torch.tensor(rows) - 1
        grids = [np.arange(count, dtype=np.float32) * np.float32(map_.spacing) for count in rows]
        samples = [map_.sample(int(route), grid) for route, grid in zip(self.route, grids, strict=True)]
        columns = [Sample.V_MAX, *range(Sample.HEADINGS, samples[0].shape[1])]
        self.road = torch.from_numpy(np.ascontiguousarray(np.concatenate(samples)[:, columns]))

    def _set_leads(self, map_: _core.Map) -> None:
        """How each vehicle (row) may follow each other (column)."""
        count = len(self.route)
        split, merge = torch.full((count, count), -torch.inf), torch.full((count, count), torch.inf)
        self.offset = torch.zeros(count, count)
        shared = {(a, b): row for a, b, *row in map_.shared_lanes}
        for i, own in enumerate(self.route.tolist()):
            for j, other in enumerate(self.route.tolist()):
                entry, merge_a, merge_b, offset = shared.get((min(own, other), max(own, other)), (-1.0, 0.0, 0.0, None))
                if own == other and i != j:
                    split[i, j] = torch.inf
                elif own != other and entry > 0.0:
                    split[i, j] = entry
                elif own != other and offset is not None:
                    merge[i, j] = merge_a if other < own else merge_b
                    self.offset[i, j] = offset if own < other else -offset
        self.split, self.merge = split, merge
        self.half_lengths = self.half[:, None] + self.half
        lanes = torch.tensor([map_.routes[route].stop_lane for route in self.route])
        self.same_lane = lanes[:, None] == lanes

    def _set_pairs(self, map_: _core.Map, pairs: Tensor) -> None:
        ends = {
            (yielder, prioritized): (yielder_end, prioritized_end)
            for yielder, prioritized, _, _, yielder_end, _, prioritized_end in map_.conflicts
        }
        rows = [ends[int(self.route[i]), int(self.route[j])] for i, j in pairs]
        self.i, self.j = pairs.unbind(1)
        self.end_i, self.end_j = torch.tensor(rows).reshape(-1, 2).unbind(1)
        self.to_i = torch.nn.functional.one_hot(self.i, len(self.route)).float()
        self.to_j = torch.nn.functional.one_hot(self.j, len(self.route)).float()

    def predict(self, assignment: Tensor) -> State:
        """How it is after 10 s, under int8 assignments (scenario, pair), completed already."""
        *_, last = self.states(assignment)
        return last

    @torch.inference_mode()
    def states(self, assignment: Tensor) -> Iterator[State]:
        """The next 10 s step by step, as of `predict`."""
        shape = (len(assignment), len(self.route))
        position, speed = self.position.expand(shape), self.speed.expand(shape)
        delta, hold = self.delta.expand(shape), torch.full(shape, -1)
        present, lost, asked = (self.position < self.length).expand(shape), torch.zeros(shape), torch.zeros(())
        for _ in range(STEPS):
            front, rear = position + self.half, position - self.half
            to_line = self.stop_line - front
            limit, headings = self._road(position)
            v_max = torch.minimum(limit, self.max_speed)
            lead, to_lead, lead_speed = self._leads(position, front, rear, speed, present)
            # who is told to wait, and who waits
            active = self._active(assignment, position, rear, present)
            open_ = active & (assignment == 0) & (hold[:, self.j] <= self.route[self.i])
            # in the order of `Gap`
            seen = (self.end_i - rear[:, self.i], speed[:, self.i], to_line[:, self.j], speed[:, self.j])
            refused = open_ & (self.gap(torch.stack(seen, -1)) <= 0.0)
            told = (active & (assignment < 0)).float() @ self.to_i + (active & (assignment > 0)).float() @ self.to_j > 0
            waits = told | (refused.float() @ self.to_i > 0)
            braking = speed.square() / (2.0 * _core.BRAKING)
            settled = delta & (to_line < braking)
            kept = active & (assignment == 0) & settled[:, self.i] & ~delta[:, self.j]
            delta = ~(waits | (kept.float() @ self.to_j > 0)) | settled
            own = torch.where(delta | ~waits, -1, torch.where(told, self.routes, self.route))
            queues = (to_lead < LEAD_RANGE) & self.same_lane[torch.arange(shape[1]), lead] & (to_line >= 0.0)
            hold = torch.maximum(own, torch.where(queues, hold.gather(1, lead), -1))
            asked = asked + open_.sum()
            # drive and advance; the features in the order of `Driving`
            features = torch.cat(
                (
                    torch.stack((to_line, speed, v_max), -1),
                    headings,
                    torch.stack((to_lead, lead_speed, delta.float()), -1),
                ),
                -1,
            )
            to_top = (torch.maximum(speed, self.max_speed) - speed) / DT
            acceleration = (self.scale * torch.tanh(self.driving(features))).minimum(to_top)
            acceleration = self._limited(acceleration, speed, to_line, delta, to_lead, lead_speed)
            lost = lost + torch.where(present, DT * (1.0 - speed / v_max), 0.0)
            faster = (speed + DT * acceleration).clamp(min=0.0)
            position = torch.where(present, position + 0.5 * DT * (speed + faster), position)
            speed = torch.where(present, faster, speed)
            present = present & (position < self.length)
            yield State(position, speed, present, lost, asked)

    def _limited(
        self, acceleration: Tensor, speed: Tensor, to_line: Tensor, delta: Tensor, to_lead: Tensor, lead_speed: Tensor
    ) -> Tensor:
        """What keeps every vehicle able to stop behind its lead, and those that wait from crossing their lines."""
        hardest = self.scale
        lead_next = (lead_speed - DT * hardest).clamp(min=0.0)
        lead_way = 0.5 * DT * (lead_speed + lead_next) + lead_next.square() / (2.0 * hardest)
        following = (speed + DT * acceleration).clamp(min=0.0)
        slower = acceleration
        bounds = ((to_lead + lead_way - LEAST_LEAD_GAP, hardest), (to_line - ROUNDED_STOP, _core.BRAKING))
        for (distance, b), free in zip(bounds, (torch.zeros_like(delta), delta), strict=True):
            rest = distance - 0.5 * DT * speed
            breaks = following * (0.5 * DT + following / (2.0 * b)) > rest
            stops = b * ((0.25 * DT**2 + rest * (2.0 / b)).clamp(min=0.0).sqrt() - 0.5 * DT)
            slower = torch.where(breaks & ~free, slower.minimum((stops - speed) / DT), slower)
        return torch.where(slower < acceleration, slower.clamp(min=-hardest), acceleration)

    def _road(self, position: Tensor) -> tuple[Tensor, Tensor]:
        """Each vehicle's v_max (scenario, vehicle) [m/s], bicycles' own aside, and relative headings (..., 6)."""
        at = (position * self.inverse_spacing).clamp(min=0.0).minimum(self.last.float())
        row = at.long().minimum(self.last - 1)
        below = self.road[self.first + row]
        between = below + (at - row).unsqueeze(-1) * (self.road[self.first + row + 1] - below)
        return between[..., 0], between[..., 1:]

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
        yielder_second = (rear[:, self.i] < self.end_i) & (position[:, self.j] < self.end_j)
        yielder_first = (rear[:, self.j] < self.end_j) & (position[:, self.i] < self.end_i)
        both = present[:, self.i] & present[:, self.j]
        return both & torch.where(assignment > 0, yielder_first, yielder_second)


def _network(weights: NetworkWeights, activation: Callable[[Tensor], Tensor]) -> Callable[[Tensor], Tensor]:
    """The network's output before any last activation, its input scaling folded into the first layer."""
    layers = [(torch.from_numpy(weight.copy()), torch.from_numpy(bias.copy())) for weight, bias in weights.layers]
    shift, scale = torch.from_numpy(weights.shift.copy()), torch.from_numpy(weights.scale.copy())
    first, bias = layers[0]
    layers[0] = first * scale, bias - first @ (scale * shift)

    def evaluate(features: Tensor) -> Tensor:
        for weight, bias in layers[:-1]:
            features = activation(torch.nn.functional.linear(features, weight, bias))
        return torch.nn.functional.linear(features, *layers[-1]).squeeze(-1)

    return evaluate
