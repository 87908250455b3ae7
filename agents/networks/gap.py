"""The gap network as a torch module; what the core evaluates after export."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

HIDDEN = 16  # paper, Table III
GAP_SHIFT = (15.0, 5.0, 30.0, 8.0)  # ours: about the middle of each feature in traffic, see `Observation.gap`
GAP_SCALE = (0.1, 0.2, 0.03, 0.15)
LEAKY_SLOPE = 0.01


class GapNetwork(nn.Module):
    """MLP_gap, 4/16/16/1 with LeakyReLU: features (..., 4) to the logit of accepting the gap (...,).

    Inputs are scaled by (x - shift) * scale, which is fixed and travels with the weights.
    """

    def __init__(self, shift: Sequence[float] = GAP_SHIFT, scale: Sequence[float] = GAP_SCALE) -> None:
        super().__init__()
        self.shift: Tensor
        self.scale: Tensor
        self.register_buffer("shift", torch.tensor(shift, dtype=torch.float32))
        self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))
        self.first = nn.Linear(len(shift), HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.last = nn.Linear(HIDDEN, 1)

    @property
    def layers(self) -> tuple[nn.Linear, nn.Linear, nn.Linear]:
        """In order."""
        return self.first, self.second, self.last

    def forward(self, features: Tensor) -> Tensor:
        """The logit (...,) of each row of features (..., 4), unscaled."""
        x = (features - self.shift) * self.scale
        x = nn.functional.leaky_relu(self.first(x), LEAKY_SLOPE)
        x = nn.functional.leaky_relu(self.second(x), LEAKY_SLOPE)
        out: Tensor = self.last(x)
        return out.squeeze(-1)


def least_logit(network: GapNetwork, features: Tensor, there: Tensor) -> Tensor:
    """The smallest logit over each yielder's foes (sample,); features (sample, foe, 4), there (sample, foe) bool."""
    logit: Tensor = network(features)
    return logit.masked_fill(~there, torch.inf).amin(dim=1)
