"""Cloning: the loss against a plain sum, and what it teaches."""

from __future__ import annotations

import pytest
import torch

from agents.networks.driving import DrivingNetwork
from imitation.cloning import Cloning, Examples, examples_of
from imitation.expert import expert_steps
from intersection_env.constants import ACCELERATION
from tests.support.networks import constant_network
from tests.support.scenes import small_scenes


def always(acceleration: float, drawn: int, states: int = 5) -> Examples:
    return Examples(torch.randn(states, 12), torch.full((states,), acceleration), drawn)


def loss_of(policy: DrivingNetwork, *examples: Examples, seed: int = 0) -> float:
    return float(Cloning(policy, examples, torch.Generator().manual_seed(seed))().detach())


def test_loss_is_the_mean_squared_difference_of_accelerations() -> None:
    network = DrivingNetwork()
    one = always(1.5, drawn=7, states=1)
    with torch.no_grad():
        does = ACCELERATION * torch.tanh(network(one.observation))
    assert loss_of(network, one) == pytest.approx(float((does - 1.5).square().mean()), rel=1e-5)


def test_each_kind_of_examples_counts_by_how_many_are_drawn() -> None:
    """A policy that keeps its speed is 1 m/s² off in a quarter of the states, and 3 in the others."""
    assert loss_of(constant_network(0.0), always(1.0, 10), always(-3.0, 30)) == pytest.approx(0.25 * 1 + 0.75 * 9)


def test_nobody_is_to_accelerate_by_more_than_a_driver_can() -> None:
    assert loss_of(constant_network(0.0), always(9.0, 10)) == pytest.approx(ACCELERATION**2)
    assert loss_of(constant_network(0.0), always(-9.0, 10)) == pytest.approx(ACCELERATION**2)


def test_examples_of_a_policy_are_what_its_mean_does() -> None:
    examples = examples_of(constant_network(0.5), torch.randn(4, 12), 2)
    torch.testing.assert_close(examples.acceleration, ACCELERATION * torch.tanh(torch.full((4,), 0.5)))
    assert not examples.acceleration.requires_grad
    assert loss_of(constant_network(0.5), examples) == pytest.approx(0.0, abs=1e-9)


def test_a_policy_learns_the_recorded_accelerations() -> None:
    network, steps = DrivingNetwork(), expert_steps(small_scenes("train", each=20), "train")
    recorded = Examples(torch.from_numpy(steps.observation), torch.from_numpy(steps.acceleration), 1024)
    cloning = Cloning(network, [recorded], torch.Generator().manual_seed(0))
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
    for _ in range(300):
        loss = cloning()
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
    everywhere = Examples(recorded.observation, recorded.acceleration, 20_000)
    assert loss_of(network, everywhere) < 0.7 * float(recorded.acceleration.var())


def test_states_are_drawn_anew_by_the_generator() -> None:
    examples = Examples(torch.randn(5000, 12), torch.randn(5000), 100)
    first, second = (Cloning(constant_network(0.0), [examples], torch.Generator().manual_seed(3)) for _ in range(2))
    one = first()
    assert one == second()
    assert first() != one
