"""What all of our networks are: two hidden layers of one width over features that are scaled first."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn


class ScaledNetwork(nn.Module):
    """N/hidden/hidden/1: features (..., N) to one number (...,).

    Inputs are scaled by (x - shift) * scale, which is fixed and travels with the weights.

    Args:
        shift, scale: of each feature.
        hidden: the width of both hidden layers.
        activation: after each of them; the output has none.
    """

    def __init__(
        self,
        shift: Sequence[float],
        scale: Sequence[float],
        hidden: int,
        activation: Callable[[Tensor], Tensor] = torch.tanh,
    ) -> None:
        super().__init__()
        self.shift: Tensor
        self.scale: Tensor
        self.register_buffer("shift", torch.tensor(shift, dtype=torch.float32))
        self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))
        self.first = nn.Linear(len(shift), hidden)
        self.second = nn.Linear(hidden, hidden)
        self.last = nn.Linear(hidden, 1)
        self.activation = activation

    @property
    def layers(self) -> tuple[nn.Linear, nn.Linear, nn.Linear]:
        """In order."""
        return self.first, self.second, self.last

    def forward(self, features: Tensor) -> Tensor:
        """The output (...,) of each row of features (..., N), unscaled."""
        return self.of_scaled(self.scaled(features))

    def scaled(self, features: Tensor) -> Tensor:
        """The features (..., N) as the first layer takes them."""
        return (features - self.shift) * self.scale

    def of_scaled(self, x: Tensor) -> Tensor:
        """As `forward`, of features that are scaled already."""
        x = self.activation(self.first(x))
        out: Tensor = self.last(self.activation(self.second(x)))
        return out.squeeze(-1)
