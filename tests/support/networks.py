"""Networks of no training, and one thread and one seed for torch."""

from __future__ import annotations

import pytest
import torch

from agents.networks.driving import Driver, DrivingNetwork

NETWORK_TOLERANCE = 1e-5
"""How far the core's networks may be from torch's; its tanh is good to 5e-7."""


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


def driver() -> Driver:
    """Random weights, moderate actions."""
    return Driver(DrivingNetwork(), DrivingNetwork(), 0.3)


def constant_network(output: float) -> DrivingNetwork:
    """A network that says the same of everything, before its tanh."""
    network = DrivingNetwork()
    for parameter in network.parameters():
        torch.nn.init.zeros_(parameter)
    torch.nn.init.constant_(network.last.bias, output)
    return network


def weights(network: torch.nn.Module) -> bytes:
    return b"".join(parameter.detach().numpy().tobytes() for parameter in network.parameters())
