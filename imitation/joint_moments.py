"""Moments as tensors, from which all vehicles are predicted jointly with gradients."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from imitation.drives import Motion
from imitation.examples import Example
from imitation.map_tables import MapTables
from imitation.torch_model import TorchPredictor, Vehicles
from imitation.torch_networks import Networks
from intersection_env import _core
from intersection_env.constants import STEPS


class JointMoments(NamedTuple):
    """Moments side by side, and what became of them.

    vehicles: at the start. assignment: (moment, pair) int8, what is implied without intervention. position, speed:
    (moment, time, vehicle) as it became [m], [m/s]. scored: (moment, time, vehicle) bool, what counts of it. width:
    (moment,) how many vehicles.
    """

    vehicles: Vehicles
    assignment: Tensor
    position: Tensor
    speed: Tensor
    scored: Tensor
    width: Tensor

    @classmethod
    def of(cls, tables: MapTables, examples: Sequence[Example]) -> JointMoments:
        """The moments of these examples, on maps that the tables know."""
        vehicles = Vehicles.of(tables, [one.traffic for one in examples])
        assignment = torch.zeros(vehicles.i.shape, dtype=torch.int8)
        shape = (len(examples), STEPS + 1, vehicles.route.shape[1])
        position, speed, scored = torch.zeros(shape), torch.zeros(shape), torch.zeros(shape, dtype=torch.bool)
        for row, one in enumerate(examples):
            count, pairs = len(one.traffic), len(one.traffic.conflicts)
            none = np.zeros((1, pairs), np.int8)
            assignment[row, :pairs] = torch.from_numpy(
                _core.complete(one.traffic.intersection.core, one.traffic.core, none)[0]
            )
            position[row, :, :count] = torch.from_numpy(one.position)
            speed[row, :, :count] = torch.from_numpy(one.speed)
            scored[row, :, :count] = torch.from_numpy(one.scored)
        return cls(vehicles, assignment, position, speed, scored, torch.tensor([len(one.traffic) for one in examples]))

    def rows(self, chosen: Tensor) -> JointMoments:
        """Some of the moments, no wider than the largest of them."""
        own = Vehicles(*(one[chosen] for one in self.vehicles))
        spare = own.route.shape[1] - 1
        most = int(self.width[chosen].max())
        pairs = int((own.i < spare).sum(1).max())
        of_vehicles = {name: one[:, : most + 1] for name, one in own._asdict().items() if name not in ("i", "j")}
        i, j = (one[:, :pairs].clamp(max=most) for one in (own.i, own.j))
        known = (one[chosen, :, : most + 1] for one in (self.position, self.speed, self.scored))
        vehicles = Vehicles(**of_vehicles, i=i, j=j)
        return JointMoments._make((vehicles, self.assignment[chosen, :pairs], *known, self.width[chosen]))

    def driven(self, tables: MapTables, networks: Networks, learns_gaps: bool) -> Motion:
        """Where everybody gets to, in all steps: (moment, step, vehicle)."""
        states = list(TorchPredictor(tables, self.vehicles, networks).states(self.assignment, learns_gaps))
        of_each = ([getattr(state, name) for state in states] for name in Motion._fields)
        return Motion(*(torch.stack(one, 1) for one in of_each))
