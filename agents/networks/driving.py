"""What drives: policy and value networks as torch modules, and as the core takes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.networks.gap import HIDDEN
from agents.networks.scaled import ScaledNetwork

DRIVING_SHIFT = (10.0, 7.0, 11.0, *[0.0] * 6, 40.0, 12.0, 0.5)  # ours: about the middle of each feature in traffic
DRIVING_SCALE = (0.05, 0.1, 0.1, *[1.0] * 6, 0.03, 0.08, 1.0)


class DrivingNetwork(ScaledNetwork):
    """MLP_acc, 12/16/16/1 with tanh: features (..., 12) to one number (...,), before any last activation."""

    def __init__(self, shift: Sequence[float] = DRIVING_SHIFT, scale: Sequence[float] = DRIVING_SCALE) -> None:
        super().__init__(shift, scale, HIDDEN)

    def packed(self) -> NDArray[np.float32]:
        """All parameters in one row, the scaling folded into the first layer: what the core's rollout reads."""
        layers = [(one.weight.detach().double().numpy(), one.bias.detach().double().numpy()) for one in self.layers]
        weight, bias = layers[0]
        scaled = weight * self.scale.double().numpy()
        layers[0] = (scaled, bias - scaled @ self.shift.double().numpy())
        return np.concatenate([part.ravel() for layer in layers for part in layer]).astype(np.float32)


class Driver(nn.Module):
    """What a rollout needs: the mean of the action before its tanh, the value, and the deviation around the mean."""

    def __init__(self, policy: DrivingNetwork, value: DrivingNetwork, sigma: float) -> None:
        super().__init__()
        self.policy, self.value = policy, value
        self.sigma: Tensor
        self.register_buffer("sigma", torch.tensor(sigma, dtype=torch.float32))

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and deviation (..., 1) of the action before its tanh; observation (..., 12)."""
        return self.of_scaled(self.policy.scaled(observation))

    def of_scaled(self, scaled: Tensor) -> tuple[Tensor, Tensor]:
        """As `forward`, of an observation that is scaled already."""
        mean = self.policy.of_scaled(scaled).unsqueeze(-1)
        return mean, self.sigma.expand_as(mean)
