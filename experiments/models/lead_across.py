"""What if a vehicle that stands across the path led? The model with this one thing changed, for `make ablations`.

The model knows leads in one's own lane alone, as the paper does, and so nothing shows a driver somebody who has
stopped on the conflict before it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from experiments.models.from_trajectories import prediction_of_trajectories
from imitation.map_tables import MapTables
from imitation.torch_model import TorchPredictor, Vehicles
from imitation.torch_networks import Networks
from intersection_env import Traffic, _core
from intersection_env.policies.file import PolicyFile
from intersection_env.prediction.predictor import Prediction

STANDING = 1.0  # [m/s] slower is standing


class AcrossPredictor(TorchPredictor):
    """Whoever stands on a conflict that one has not reached leads too, as if its border were a rear bumper."""

    def __init__(self, tables: MapTables, vehicles: Vehicles, networks: Networks) -> None:
        super().__init__(tables, vehicles, networks)
        own, other = vehicles.route[:, :, None], vehicles.route[:, None, :]
        # whoever yields; two routes of these maps conflict once
        on_own = torch.maximum(tables.on_yielder, tables.on_prioritized.transpose(1, 2))
        self.own_begin = on_own[0][own, other]  # of who follows (row), on its route
        self.other_begin, self.other_end = on_own[:, other, own]

    def _leads(
        self, position: Tensor, front: Tensor, rear: Tensor, speed: Tensor, present: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        lead, further, to_lead, lead_speed = super()._leads(position, front, rear, speed, present)
        stands = present & (speed < STANDING)
        is_on = (front[:, None, :] > self.other_begin) & (rear[:, None, :] < self.other_end)
        before = self.own_begin - front[:, :, None]
        to_across, across = torch.where(stands[:, None, :] & is_on & (before >= 0.0), before, torch.inf).min(-1)
        nearer = to_across < to_lead
        return (
            torch.where(nearer, across, lead),
            further,
            torch.where(nearer, to_across, to_lead),
            torch.where(nearer, speed.gather(1, across), lead_speed),
        )


@dataclass(frozen=True)
class TorchForecaster:
    """The model as plain torch operations, in the case in which nobody intervenes."""

    name: str
    policy: PolicyFile
    model: type[TorchPredictor]

    def predict(self, traffic: Traffic) -> Prediction:
        """As of `Predictor.predict`."""
        bound = self.model.of(traffic, self.policy)
        none = np.zeros((1, len(traffic.conflicts)), np.int8)
        completed = _core.complete(traffic.intersection.core, traffic.core, none)
        with torch.inference_mode():
            states = list(bound.states(torch.from_numpy(completed)))
        position, speed, present = (
            torch.cat([getattr(bound.vehicles, name), *(getattr(state, name) for state in states)]).numpy()
            for name in ("position", "speed", "present")
        )
        return prediction_of_trajectories(traffic, position, speed, present)
