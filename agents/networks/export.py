"""Networks to policy files and back."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any, TypeVar

import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.gap import GapNetwork
from agents.networks.order import OrderNetwork
from intersection_env.policies.file import NetworkWeights, PolicyFile

Network = TypeVar("Network", GapNetwork, DrivingNetwork, OrderNetwork)


def policy_file(network: GapNetwork, about: Mapping[str, Any]) -> PolicyFile:
    """The policy of this gap network with the IDM as driver."""
    return PolicyFile("network", "idm", gap_network=network_weights(network), about=about)


def driving_policy(gap: PolicyFile, driver: DrivingNetwork, about: Mapping[str, Any]) -> PolicyFile:
    """The policy that decides gaps as `gap` does and drives by this network."""
    return dataclasses.replace(gap, driver="network", driving_network=network_weights(driver), about=about)


def gap_hash(gap: PolicyFile) -> str:
    """SHA-256 of what decides about gaps, whatever the file says about itself and holds for forecasts."""
    plain = dataclasses.replace(gap, about={}, order_network=None, spread=None)
    return hashlib.sha256(plain.text().encode()).hexdigest()


def network_weights(network: GapNetwork | DrivingNetwork | OrderNetwork) -> NetworkWeights:
    """As a policy file holds them."""
    layers = [(layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy()) for layer in network.layers]
    return NetworkWeights(network.shift.numpy().copy(), network.scale.numpy().copy(), layers)


def gap_network(policy: PolicyFile) -> GapNetwork:
    """The gap network of a policy file, as a torch module.

    Raises:
        ValueError: the policy decides gaps by a rule.
    """
    if policy.gap_network is None:
        raise ValueError(f'the policy decides gaps by "{policy.gap}" and holds no gap network')
    weights = policy.gap_network
    return _filled(GapNetwork(weights.shift.tolist(), weights.scale.tolist()), weights)


def driving_network(policy: PolicyFile) -> DrivingNetwork:
    """The driving network of a policy file, as a torch module.

    Raises:
        ValueError: the policy drives by a rule.
    """
    if policy.driving_network is None:
        raise ValueError(f'the policy drives by "{policy.driver}" and holds no driving network')
    weights = policy.driving_network
    return _filled(DrivingNetwork(weights.shift.tolist(), weights.scale.tolist()), weights)


def order_network(policy: PolicyFile) -> OrderNetwork:
    """The order network of a policy file, as a torch module.

    Raises:
        ValueError: the policy holds none.
    """
    if policy.order_network is None:
        raise ValueError("the policy holds no order network")
    weights = policy.order_network
    return _filled(OrderNetwork(weights.shift.tolist(), weights.scale.tolist()), weights)


def _filled(network: Network, weights: NetworkWeights) -> Network:
    with torch.no_grad():
        for layer, (weight, bias) in zip(network.layers, weights.layers, strict=True):
            layer.weight.copy_(torch.from_numpy(weight))
            layer.bias.copy_(torch.from_numpy(bias))
    return network
