"""Behaviour cloning of the recorded drivers, from a Minari data set, judged in the environment that it came from.

make setup && .venv/bin/pip install "minari[hdf5]" pillow
.venv/bin/python -m data.minari
.venv/bin/python examples/learning/minari_cloning.py
"""

# /// script
# dependencies = ["intersection_env", "minari[hdf5]", "pillow", "torch"]
# ///

from __future__ import annotations

import argparse

import minari
import numpy as np
import torch
from torch import Tensor, nn

DATA_SET = "intersection_env/bendplatz/train-v0"
EPISODES = 100  # of a measurement
BATCH, LEARNING_RATE = 256, 1e-3


def samples(data_set: minari.MinariDataset) -> tuple[Tensor, Tensor]:
    """What the drivers saw (step, 12) and did (step, 1)."""
    episodes = list(data_set.iterate_episodes())
    seen = np.concatenate([one.observations[:-1] for one in episodes])
    return torch.from_numpy(seen), torch.from_numpy(np.concatenate([one.actions for one in episodes]))


class Clone(nn.Module):
    """Observations (..., 12), divided by the largest ones, to actions (..., 1)."""

    def __init__(self, largest: Tensor) -> None:
        super().__init__()
        self.register_buffer("largest", largest)
        layers = nn.Linear(12, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1), nn.Tanh()
        self.layers = nn.Sequential(*layers)

    def forward(self, observation: Tensor) -> Tensor:
        """The actions."""
        return self.layers(observation / self.largest)


def returns(policy: nn.Module, data_set: minari.MinariDataset, seed: int) -> float:
    """The mean return of the policy in new episodes."""
    environment = data_set.recover_environment()
    found = []
    for episode in range(EPISODES):
        observation, _ = environment.reset(seed=seed + episode)
        is_over, paid = False, 0.0
        while not is_over:
            with torch.no_grad():
                action = policy(torch.from_numpy(observation)).numpy()
            observation, reward, terminated, truncated, _ = environment.step(action)
            paid += float(reward)
            is_over = terminated or truncated
        found.append(paid)
    return float(np.mean(found))


def main() -> None:
    """Learns, and prints what the recorded drivers and their clone were paid."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--passes", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)  # such small networks gain nothing from more
    data_set = minari.load_dataset(DATA_SET)
    seen, did = samples(data_set)
    paid = np.mean([one.rewards.sum() for one in data_set.iterate_episodes()])
    print(f"recorded drivers: return {paid:9.1f} in {data_set.total_episodes} episodes", flush=True)
    clone = Clone(seen.abs().amax(dim=0))
    optimizer = torch.optim.Adam(clone.parameters(), LEARNING_RATE)
    for _ in range(options.passes):
        for part in torch.randperm(len(seen)).split(BATCH):
            loss = (clone(seen[part]) - did[part]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    print(f"their clone:      return {returns(clone, data_set, options.seed):9.1f} in {EPISODES} episodes")


if __name__ == "__main__":
    main()
