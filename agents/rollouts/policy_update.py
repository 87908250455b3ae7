"""What a rollout teaches policy and value: advantages, then passes of clipped updates (PPO), with TorchRL's parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.modules import IndependentNormal, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from agents.networks.driving import Driver, DrivingNetwork

LEARNT_FROM = ("observation", "action", "action_log_prob", "advantage", "value_target")
ADAM_EPSILON = 1e-5
CRITIC_SHARE = 0.5


@dataclass(frozen=True)
class UpdateSettings:
    """How policy and value follow a rollout."""

    gamma: float = 0.98
    """Discount a step of 0.2 s."""
    trace: float = 0.95
    """GAE's lambda."""
    clip: float = 0.2
    """How far the ratio of probabilities may go from 1."""
    passes: int = 5
    """Over a rollout."""
    minibatches: int = 6
    """Of a rollout, one update each."""
    largest_kl: float = 0.03
    """At which the passes over a rollout end."""
    gradient_norm: float = 0.5
    """Longer gradients are shortened to it."""


class PolicyUpdate:
    """Updates a driver's policy and value networks, with one Adam for both."""

    def __init__(self, driver: Driver, settings: UpdateSettings) -> None:
        """Updates this driver, whose networks scale their inputs alike."""
        assert torch.equal(driver.policy.shift, driver.value.shift)
        assert torch.equal(driver.policy.scale, driver.value.scale)
        self.driver, self.settings = driver, settings
        self.parameters = [*driver.policy.parameters(), *driver.value.parameters()]
        self.optimizer = torch.optim.Adam(self.parameters, eps=ADAM_EPSILON)
        actor = ProbabilisticActor(
            TensorDictModule(driver.of_scaled, ["scaled"], ["loc", "scale"]),
            in_keys=["loc", "scale"],
            distribution_class=IndependentNormal,
            distribution_kwargs={"tanh_loc": False},
            return_log_prob=True,
        )
        critic = TensorDictModule(_Value(driver.value), ["scaled"], ["state_value"])
        self._gae = GAE(gamma=settings.gamma, lmbda=settings.trace, value_network=None, vectorized=False)
        self._loss = ClipPPOLoss(
            actor,
            critic,
            clip_epsilon=settings.clip,
            entropy_bonus=False,
            critic_coeff=CRITIC_SHARE,
            functional=False,
            log_explained_variance=False,
        )

    def advantages(self, rollout: TensorDict) -> TensorDict:
        """The rollout's samples in one row, with "advantage", to mean 0 and deviation 1, and "value_target"."""
        self._gae(rollout)
        samples = rollout.select(*LEARNT_FROM).reshape(-1)
        advantage = samples["advantage"]
        samples["advantage"] = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        return samples

    def __call__(
        self,
        samples: TensorDict,
        learning_rate: float,
        generator: torch.Generator,
        value_only: bool = False,
        beside: Callable[[], Tensor] | None = None,
    ) -> dict[str, float]:
        """All passes over the samples of `advantages`, which it shuffles once; stops early at the largest KL.

        value_only: leave the policy as it is.
        beside: another loss of the policy, added to that of each update.

        Returns:
            kl, of the last update's samples; clipped, their share; value_loss, mean; updates, their count.
        """
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate
        samples = samples.exclude("observation").set("scaled", self.driver.policy.scaled(samples["observation"]))
        order = torch.randperm(len(samples), generator=generator)
        samples = samples.apply(lambda values: values.index_select(0, order))  # twice as fast as samples[order]
        value_loss, updates = 0.0, 0
        terms: Any = None
        for _ in range(self.settings.passes):
            for part in samples.chunk(self.settings.minibatches):
                terms = self._loss(part)
                self.optimizer.zero_grad()
                loss = terms["loss_critic"] if value_only else terms["loss_critic"] + terms["loss_objective"]
                if beside is not None and not value_only:
                    loss = loss + beside()
                loss.backward()
                nn.utils.clip_grad_norm_(self.parameters, self.settings.gradient_norm)
                self.optimizer.step()
                value_loss += float(terms["loss_critic"].detach()) / CRITIC_SHARE
                updates += 1
            if float(terms["kl_approx"]) > self.settings.largest_kl:
                break
        return {
            "kl": float(terms["kl_approx"]),
            "clipped": float(terms["clip_fraction"]),
            "value_loss": value_loss / updates,
            "updates": updates,
        }


class _Value(nn.Module):
    def __init__(self, value: DrivingNetwork) -> None:
        super().__init__()
        self.value = value

    def forward(self, scaled: Tensor) -> Tensor:
        return self.value.of_scaled(scaled).unsqueeze(-1)
