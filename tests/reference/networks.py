"""Networks: fully connected layers on scaled inputs."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tests.reference.intersection import Floats


@dataclass(frozen=True)
class Network:
    """Fully connected layers (weight (output, input), bias (output,)) on inputs scaled by (x - shift) * scale."""

    shift: Floats
    scale: Floats
    layers: tuple[tuple[Floats, Floats], ...]


def evaluate(network: Network, features: Floats, activation: Literal["leaky_relu", "tanh"]) -> float:
    """The network's one output; the activation follows every layer but the last."""
    x = (features - network.shift) * network.scale
    for number, (weight, bias) in enumerate(network.layers):
        x = weight @ x + bias
        if number < len(network.layers) - 1:
            x = np.tanh(x) if activation == "tanh" else np.where(x > 0, x, 0.01 * x)
    return float(x[0])
