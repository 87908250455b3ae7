"""The discriminator, its reward and its loss, against plain sums."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torch import Tensor, nn

from imitation.discriminator import Discriminator, DiscriminatorLoss, DiscriminatorSettings
from imitation.expert import expert_steps
from intersection_env.features import DRIVING_FEATURES
from tests.support.scenes import small_scenes

FEATURES = len(DRIVING_FEATURES)


def rows(count: int, shift: float = 0.0, seed: int = 0) -> Tensor:
    """Features about 3, in very different units."""
    generator = torch.Generator().manual_seed(seed)
    return 3.0 + torch.logspace(-2, 2, FEATURES) * (shift + torch.randn(count, FEATURES, generator=generator))


def learned(
    expert: Tensor, policy: Tensor, updates: int = 60, **settings: Any
) -> tuple[Discriminator, list[TensorDict]]:
    """A discriminator after so many updates, and what its loss gave at each."""
    torch.manual_seed(1)
    discriminator = Discriminator.of(expert)
    loss = DiscriminatorLoss(
        discriminator, DiscriminatorSettings(**{"gradient_penalty": 0.0, **settings}), torch.Generator().manual_seed(0)
    )
    optimizer = torch.optim.Adam(discriminator.parameters(), lr=1e-3)
    seen = []
    for _ in range(updates):
        terms = loss(TensorDict({"expert": expert, "policy": policy}))
        optimizer.zero_grad()
        terms["loss_discriminator"].backward()
        optimizer.step()
        seen.append(terms.detach())
    return discriminator, seen


def test_discriminator_separates_two_different_sets() -> None:
    expert, policy = rows(1000), rows(1000, shift=1.5, seed=1)
    discriminator, seen = learned(expert, policy)
    assert seen[-1]["accuracy"] > 0.95
    unseen = rows(1000, seed=2), rows(1000, shift=1.5, seed=3)
    with torch.no_grad():
        assert (discriminator(unseen[0]) > 0).float().mean() > 0.95
        assert (discriminator(unseen[1]) < 0).float().mean() > 0.95
    reward = [discriminator.reward(one) for one in unseen]
    assert reward[0].mean() > 0.5
    assert reward[1].mean() < -0.5


def test_reward_is_minus_the_log_of_being_the_policys_and_0_where_there_is_no_telling() -> None:
    discriminator, _ = learned(rows(100), rows(100, shift=1.0, seed=1), updates=20)
    with torch.no_grad():
        likely = torch.sigmoid(discriminator(rows(50, seed=5)).double())
    torch.testing.assert_close(discriminator.reward(rows(50, seed=5)).double(), -torch.log1p(-likely) - np.log(2.0))
    with torch.no_grad():
        for parameter in discriminator.layers[-1].parameters():
            parameter.zero_()
    torch.testing.assert_close(discriminator.reward(rows(50)), torch.zeros(50))


def test_discriminator_sits_at_chance_on_two_halves_of_one_set() -> None:
    both = torch.from_numpy(expert_steps(small_scenes("train", each=20), "train").observation)
    shuffled = both[torch.randperm(len(both))][: len(both) // 2 * 2]
    _, seen = learned(shuffled[::2], shuffled[1::2])
    accuracy = torch.stack([terms["accuracy"] for terms in seen])
    assert ((accuracy > 0.45) & (accuracy < 0.55)).all()


def test_features_are_scaled_to_the_experts_once_and_for_all() -> None:
    expert, policy = rows(1000), rows(1000, shift=3.0, seed=1)
    expert[:, 4] = 7.0  # a feature that never changes
    discriminator, _ = learned(expert, policy, updates=5)
    torch.testing.assert_close(discriminator.mean, expert.mean(dim=0))
    clean = discriminator.normalised(expert).double()
    torch.testing.assert_close(clean.mean(dim=0), torch.zeros(FEATURES).double(), atol=1e-3, rtol=0)
    varied = torch.arange(FEATURES) != 4
    torch.testing.assert_close(clean.std(dim=0)[varied], torch.ones(FEATURES - 1).double(), atol=1e-3, rtol=0)
    assert torch.isfinite(discriminator(policy)).all()
    assert not {"mean", "deviation"} & dict(discriminator.named_parameters()).keys()


class Spy(nn.Module):
    """Layers that keep what they are given, and answer with one number."""

    def __init__(self, logit: float) -> None:
        super().__init__()
        self.logit = nn.Parameter(torch.tensor(logit))
        self.seen = torch.zeros(0)

    def forward(self, features: Tensor) -> Tensor:
        self.seen = features.detach()
        return self.logit.expand(len(features), 1)


def spied(logit: float, **settings: Any) -> tuple[Spy, TensorDict]:
    expert, policy = rows(3000), rows(3000, shift=1.0, seed=1)
    discriminator, spy = Discriminator.of(expert), Spy(logit)
    discriminator.layers = spy  # type: ignore[assignment]
    loss = DiscriminatorLoss(
        discriminator, DiscriminatorSettings(**{"gradient_penalty": 0.0, **settings}), torch.Generator().manual_seed(0)
    )
    terms = loss(TensorDict({"expert": expert, "policy": policy}))
    clean = discriminator.normalised(torch.cat([expert, policy]))
    spy.seen = spy.seen - clean
    return spy, terms.detach()


def test_an_epoch_takes_every_row_once_a_pass_in_minibatches() -> None:
    seen = torch.arange(100.0).unsqueeze(1)
    parts = list(DiscriminatorSettings(passes=3, minibatches=4).parts(seen, torch.Generator().manual_seed(0)))
    assert [len(part) for part in parts] == [25] * 12
    for first in (0, 4, 8):
        one = torch.cat(parts[first : first + 4])
        assert not torch.equal(one, seen)
        torch.testing.assert_close(one.sort(dim=0).values, seen)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5])
def test_noise_of_the_stated_deviation_is_on_both_sides(noise: float) -> None:
    spy, _ = spied(0.0, noise=noise)
    for side in (spy.seen[:3000], spy.seen[3000:]):
        assert float(side.std()) == pytest.approx(noise, rel=0.02)
        assert abs(float(side.mean())) <= 4 * noise * side.numel() ** -0.5


@pytest.mark.parametrize("smoothing", [0.0, 0.1, 0.3])
def test_labels_are_softened_as_stated(smoothing: float) -> None:
    _, terms = spied(1.5, smoothing=smoothing)
    log_yes, log_no = np.log(1 / (1 + np.exp(-1.5))), np.log(1 / (1 + np.exp(1.5)))
    expert = (1 - smoothing) * log_yes + smoothing * log_no
    policy = smoothing * log_yes + (1 - smoothing) * log_no
    assert float(terms["loss_discriminator"]) == pytest.approx(-(expert + policy) / 2, rel=1e-5)
    assert float(terms["accuracy"]) == 0.5


def test_gradient_penalty_draws_the_gradient_to_0() -> None:
    expert, policy = rows(300), rows(300, shift=3.0, seed=1)
    norms = {}
    for weight in (1e-9, 10.0):  # at 0 the norm is not even watched
        _, seen = learned(expert, policy, updates=150, gradient_penalty=weight, smoothing=0.0)
        norms[weight] = [float(terms["gradient_norm"]) for terms in seen]
    assert norms[10.0][-1] < 0.15
    assert norms[1e-9][-1] > 1.3
