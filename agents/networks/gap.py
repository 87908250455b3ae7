"""The gap network as a torch module; what the core evaluates after export."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import torch
from torch import Tensor
from torch.nn.functional import leaky_relu

from agents.networks.scaled import ScaledNetwork

HIDDEN = 16  # paper, Table III
GAP_SHIFT = (15.0, 5.0, 30.0, 8.0)  # ours: about the middle of each feature in traffic, see `Observation.gap`
GAP_SCALE = (0.1, 0.2, 0.03, 0.15)
LEAKY_SLOPE = 0.01


class GapNetwork(ScaledNetwork):
    """MLP_gap, 4/16/16/1 with LeakyReLU: features (..., 4) to the logit of accepting the gap (...,)."""

    def __init__(self, shift: Sequence[float] = GAP_SHIFT, scale: Sequence[float] = GAP_SCALE) -> None:
        super().__init__(shift, scale, HIDDEN, partial(leaky_relu, negative_slope=LEAKY_SLOPE))


def least_logit(network: GapNetwork, features: Tensor, there: Tensor) -> Tensor:
    """The smallest logit over each yielder's foes (sample,); features (sample, foe, 4), there (sample, foe) bool."""
    logit: Tensor = network(features)
    return logit.masked_fill(~there, torch.inf).amin(dim=1)
