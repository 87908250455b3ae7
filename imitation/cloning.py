"""Cloning: what a policy would do in given states, compared with what somebody else did, or would do, there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from agents.networks.driving import DrivingNetwork
from intersection_env.constants import ACCELERATION


@dataclass(frozen=True)
class Examples:
    """States, and what is to be done there.

    observation: (state, 12), the features in their units. acceleration: (state,) [m/s²].
    """

    observation: Tensor
    acceleration: Tensor
    drawn: int
    """At each call of `Cloning`."""


def examples_of(policy: DrivingNetwork, observation: Tensor, drawn: int) -> Examples:
    """What this policy would do there, by its mean action."""
    with torch.no_grad():
        return Examples(observation, ACCELERATION * torch.tanh(policy(observation)), drawn)


class Cloning:
    """The mean squared difference of accelerations [(m/s²)²], over examples of each kind that are drawn anew."""

    def __init__(self, policy: DrivingNetwork, examples: Sequence[Examples], generator: torch.Generator) -> None:
        self.policy, self.examples, self.generator = policy, examples, generator

    def __call__(self) -> Tensor:
        """The loss, through which the policy learns."""
        chosen = [
            torch.randint(len(kind.acceleration), (kind.drawn,), generator=self.generator) for kind in self.examples
        ]
        seen = torch.cat([kind.observation[rows] for kind, rows in zip(self.examples, chosen, strict=True)])
        wanted = torch.cat([kind.acceleration[rows] for kind, rows in zip(self.examples, chosen, strict=True)])
        does = ACCELERATION * torch.tanh(self.policy(seen))
        return (does - wanted.clamp(-ACCELERATION, ACCELERATION)).square().mean()
