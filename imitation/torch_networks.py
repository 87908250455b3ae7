"""Both networks as torch evaluates them: what drives, within the limits of predictions, and who decides about gaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from intersection_env import _core
from intersection_env.constants import ACCELERATION, DT
from intersection_env.features import Driving
from intersection_env.policies.file import NetworkWeights, PolicyFile

LEAST_LEAD_GAP, BEFORE_LINE = 1.0, 0.4  # [m], of what limits a network
LEAST_ROOT = 1e-12  # keeps the slope of a root finite

Network = Callable[[Tensor], Tensor]
"""Features (..., input) to its output (...,), before any last activation."""


class View(NamedTuple):
    """What drivers see but for their decisions: (...,) each in the order of `Driving`, headings (..., 6)."""

    to_line: Tensor
    speed: Tensor
    v_max: Tensor
    headings: Tensor
    to_lead: Tensor
    lead_speed: Tensor

    @classmethod
    def of(cls, features: Tensor) -> tuple[View, Tensor]:
        """The view and the decisions that these features (..., 12) show."""
        first, last = features[..., : Driving.HEADINGS].unbind(-1), features[..., Driving.LEAD_DISTANCE :].unbind(-1)
        headings = features[..., Driving.HEADINGS : Driving.LEAD_DISTANCE]
        return cls._make((*first, headings, *last[:2])), last[2] > 0.0

    def features(self, delta: Tensor) -> Tensor:
        """The driving network's (..., 12), with decisions (...,) bool."""
        own = torch.stack((self.to_line, self.speed, self.v_max), -1)
        rest = torch.stack((self.to_lead, self.lead_speed, delta.float()), -1)
        return torch.cat((own, self.headings, rest), -1)


@dataclass(frozen=True)
class Networks:
    """Who drives, who decides about gaps, and the acceleration that is the driver's 1 [m/s²]."""

    driving: Network
    gap: Network
    scale: float = ACCELERATION

    @classmethod
    def of(cls, policy: PolicyFile) -> Networks:
        """Those of a policy file with both networks, without gradients of their weights."""
        assert policy.gap_network is not None
        assert policy.driving_network is not None
        gap = _evaluated(policy.gap_network, torch.nn.functional.leaky_relu)  # slope 0.01
        return cls(_evaluated(policy.driving_network, torch.tanh), gap, policy.acceleration_scale)

    def drive(self, view: View, delta: Tensor, noise: Tensor | None = None, max_speed: Tensor | None = None) -> Tensor:
        """The accelerations (...,) [m/s²] with decisions (...,) bool, within what a prediction allows.

        noise: (..., 12), added to what the driver sees, not to what limits it. max_speed: (...,) the vehicles' own top
        speeds [m/s]; None: unbounded.
        """
        seen = view.features(delta)
        wanted = self.scale * torch.tanh(self.driving(seen if noise is None else seen + noise))
        if max_speed is not None:
            wanted = wanted.minimum((torch.maximum(view.speed, max_speed) - view.speed) / DT)
        return _limited(wanted, view, delta, self.scale)


def _limited(wanted: Tensor, view: View, delta: Tensor, hardest: float) -> Tensor:
    """What keeps every vehicle able to stop behind its lead, and those that wait from crossing their lines."""
    speed, lead_speed = view.speed, view.lead_speed
    lead_next = (lead_speed - DT * hardest).clamp(min=0.0)
    lead_way = 0.5 * DT * (lead_speed + lead_next) + lead_next.square() / (2.0 * hardest)
    following = (speed + DT * wanted).clamp(min=0.0)
    slower = wanted
    bounds = ((view.to_lead + lead_way - LEAST_LEAD_GAP, hardest), (view.to_line - BEFORE_LINE, _core.BRAKING))
    for (distance, b), free in zip(bounds, (torch.zeros_like(delta), delta), strict=True):
        rest = distance - 0.5 * DT * speed
        breaks = following * (0.5 * DT + following / (2.0 * b)) > rest
        stops = b * ((0.25 * DT**2 + rest * (2.0 / b)).clamp(min=LEAST_ROOT).sqrt() - 0.5 * DT)
        slower = torch.where(breaks & ~free, slower.minimum((stops - speed) / DT), slower)
    return torch.where(slower < wanted, slower.clamp(min=-hardest), wanted)


def _evaluated(weights: NetworkWeights, activation: Callable[[Tensor], Tensor]) -> Network:
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
