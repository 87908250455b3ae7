"""The discriminator of GAIL: what tells recorded drivers from the policy, and the loss it learns by."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import dispatch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, softplus
from torchrl.objectives.common import LossModule

HIDDEN = 64  # paper, Table III


@dataclass(frozen=True)
class DiscriminatorSettings:
    """How the discriminator learns."""

    passes: int = 4
    """In an epoch, over all of the policy's steps; paper, Table III (there an update is on all at once)."""
    minibatches: int = 8
    """Of these steps, one update each."""
    learning_rate: float = 1e-3
    """Paper, Table III."""
    smoothing: float = 0.1
    """Labels are this far from 0 and 1."""
    noise: float = 0.1
    """Deviation of what is added to the normalised features of both sides."""
    gradient_penalty: float = 0.01
    """Weight of the squared gradient at points between both sides.

    Source: Mescheder et al. 2018, "Which training methods for GANs do actually converge?": drawn to 0, not to 1."""
    most_accuracy: float = 1.0
    """Above it, an update is left out."""

    def parts(self, rows: Tensor, generator: torch.Generator) -> Iterator[Tensor]:
        """The rows of each update of an epoch."""
        for _ in range(self.passes):
            yield from rows[torch.randperm(len(rows), generator=generator)].chunk(self.minibatches)


class Discriminator(nn.Module):
    """MLP 12/64/64/1 with ReLU: features (..., 12) to the logit of being an expert's (...,).

    Features are shifted and scaled to the expert's mean and deviation, once and for all.
    """

    def __init__(self, mean: Tensor, deviation: Tensor) -> None:
        super().__init__()
        self.mean: Tensor
        self.deviation: Tensor
        self.register_buffer("mean", mean.clone())
        self.register_buffer("deviation", deviation.clone())
        self.layers = nn.Sequential(
            nn.Linear(len(mean), HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 1)
        )

    @classmethod
    def of(cls, expert: Tensor) -> Discriminator:
        """A new one for such expert features (row, 12)."""
        return cls(expert.mean(dim=0), expert.std(dim=0).clamp(min=1e-3))

    def normalised(self, features: Tensor) -> Tensor:
        """Features as the layers take them."""
        return (features - self.mean) / self.deviation

    def forward(self, features: Tensor) -> Tensor:
        """The logit (...,) of each row of features (..., 12), in their units."""
        logit: Tensor = self.layers(self.normalised(features))
        return logit.squeeze(-1)

    def reward(self, features: Tensor) -> Tensor:
        """-log(1 - probability of being an expert's) - log 2 (...,): above 0 where an expert is likelier.

        It is 0 where there is no telling, so the steps that a collision cuts off are worth next to nothing once the
        driver is like the recorded ones. Were it above 0 everywhere, each step would pay, and driving slower and safer.
        """
        with torch.no_grad():
            return softplus(self(features)) - math.log(2.0)


class DiscriminatorLoss(LossModule):  # type: ignore[misc]  # TorchRL is untyped
    """Cross entropy on logits between expert and policy, with soft labels, noisy inputs and a gradient penalty.

    Takes "expert" and "policy", features (row, 12), as many of the one as of the other; gives "loss_discriminator",
    and for watching "accuracy", the share of rows on the right side, and "gradient_norm", the mean one.
    """

    in_keys = ("expert", "policy")
    out_keys = ("loss_discriminator", "accuracy", "gradient_norm")
    discriminator: Discriminator

    def __init__(
        self, discriminator: Discriminator, settings: DiscriminatorSettings, generator: torch.Generator
    ) -> None:
        super().__init__()
        self.discriminator = discriminator
        self.settings, self.generator = settings, generator

    @dispatch  # type: ignore[untyped-decorator]  # TorchRL is untyped
    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        """The loss and what is watched of it."""
        expert, policy = self._noisy(tensordict["expert"]), self._noisy(tensordict["policy"])
        logit = self.discriminator.layers(torch.cat([expert, policy])).squeeze(-1)
        is_expert = torch.arange(len(logit)) < len(expert)
        label = torch.where(is_expert, 1.0 - self.settings.smoothing, self.settings.smoothing)
        loss = binary_cross_entropy_with_logits(logit, label)
        norm = torch.zeros(())
        if self.settings.gradient_penalty:
            norm = self._gradient_norm(expert, policy)
            loss = loss + self.settings.gradient_penalty * norm.square().mean()
        accuracy = ((logit > 0) == is_expert).float().mean()
        figures: dict[str, Any] = {"accuracy": accuracy, "gradient_norm": norm.mean().detach()}
        return TensorDict({"loss_discriminator": loss, **figures})

    def _noisy(self, features: Tensor) -> Tensor:
        """Normalised, with noise."""
        clean = self.discriminator.normalised(features)
        return clean + self.settings.noise * torch.randn(clean.shape, generator=self.generator)

    def _gradient_norm(self, expert: Tensor, policy: Tensor) -> Tensor:
        """Of the logit by the normalised features, at a random point between each two rows."""
        share = torch.rand(len(expert), 1, generator=self.generator)
        between = (share * expert + (1.0 - share) * policy).detach().requires_grad_(True)
        (gradient,) = torch.autograd.grad(self.discriminator.layers(between).sum(), between, create_graph=True)
        norm: Tensor = gradient.norm(dim=1)
        return norm
