"""Moments as tensors side by side: predicted jointly by the core, held to what became of them, learned from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from imitation.adjoint import Rollout
from imitation.examples import Example
from imitation.map_tables import MapTables
from imitation.torch_model import Vehicles
from intersection_env import Traffic, _core
from intersection_env.constants import STEPS
from intersection_env.prediction.predictor import Predictor


class JointMoments(NamedTuple):
    """Moments, and what became of them.

    traffics: (moment,). vehicles: the same as tensors. assignment: (moment, pair) int8, what is implied without
    intervention. position, speed: (time, moment, vehicle) as it became [m], [m/s]. scored: (time, moment, vehicle)
    bool, what counts of it. width: (moment,) how many vehicles.
    """

    traffics: Sequence[Traffic]
    vehicles: Vehicles
    assignment: Tensor
    position: Tensor
    speed: Tensor
    scored: Tensor
    width: Tensor

    @classmethod
    def of(cls, tables: MapTables, examples: Sequence[Example]) -> JointMoments:
        """The moments of these examples, on maps that the tables know."""
        traffics = [one.traffic for one in examples]
        vehicles = Vehicles.of(tables, traffics)
        assignment = torch.zeros(vehicles.i.shape, dtype=torch.int8)
        for row, traffic in enumerate(traffics):
            none = np.zeros((1, len(traffic.conflicts)), np.int8)
            implied = _core.complete(traffic.intersection.core, traffic.core, none)
            assignment[row, : implied.shape[1]] = torch.from_numpy(implied[0])
        shape = (STEPS + 1, *vehicles.route.shape)
        position, speed, scored = torch.zeros(shape), torch.zeros(shape), torch.zeros(shape, dtype=torch.bool)
        for row, one in enumerate(examples):
            count = len(one.traffic)
            position[:, row, :count] = torch.from_numpy(one.position)
            speed[:, row, :count] = torch.from_numpy(one.speed)
            scored[:, row, :count] = torch.from_numpy(one.scored)
        width = torch.tensor([len(traffic) for traffic in traffics])
        return cls(traffics, vehicles, assignment, position, speed, scored, width)

    def rows(self, chosen: Tensor) -> JointMoments:
        """Some of the moments, no wider than the largest of them."""
        own = Vehicles(*(one[chosen] for one in self.vehicles))
        spare, most = own.route.shape[1] - 1, int(self.width[chosen].max())
        pairs = int((own.i < spare).sum(1).max())
        of_vehicles = {name: one[:, : most + 1] for name, one in own._asdict().items() if name not in ("i", "j")}
        i, j = (one[:, :pairs].clamp(max=most) for one in (own.i, own.j))
        known = (one[:, chosen, : most + 1] for one in (self.position, self.speed, self.scored))
        traffics = [self.traffics[row] for row in chosen.tolist()]
        assignment = self.assignment[chosen, :pairs]
        return JointMoments._make((traffics, Vehicles(**of_vehicles, i=i, j=j), assignment, *known, self.width[chosen]))

    def predicted(self, predictor: Predictor) -> Rollout:
        """What the core predicts of them, without intervention."""
        shape = (STEPS + 1, *self.vehicles.route.shape)
        position, speed = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        enters, present = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
        for row, traffic in enumerate(self.traffics):
            found, count = predictor.predict(traffic), len(traffic)
            filled = ((position, found.position), (speed, found.speed))
            for array, values in (*filled, (enters, found.enters), (present, found.present)):
                array[:, row, :count] = values[0]
        return Rollout(*(torch.from_numpy(one) for one in (position, speed, enters, present)))
