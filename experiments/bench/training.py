"""Times an epoch of PPO on one core, part by part: collection, advantages, one pass of updates.

A part of `make bench`; by itself: python -m experiments.bench --part training
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import torch

from agents.networks.driving import Driver, DrivingNetwork
from agents.ppo import PROFILES, environments
from agents.rollouts.collector import Rollouts
from agents.rollouts.policy_update import PolicyUpdate

ROUNDS = 5


def training_rates() -> dict[str, float]:
    """Nanoseconds a step of an agent, the best of five rounds, by part; and million steps a second in all."""
    settings = PROFILES["fast"][1]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    worlds = [env.worlds for env in environments(settings, worlds=settings.worlds, threads=1)]
    for batch in worlds:
        batch.reset(0, desynchronise=True)
    driver = Driver(DrivingNetwork(), DrivingNetwork(), settings.sigma)
    rollouts, generator = Rollouts(worlds, settings.steps), torch.Generator().manual_seed(0)
    update = PolicyUpdate(driver, dataclasses.replace(settings.update, passes=1))
    steps = sum(batch.action.size for batch in worlds) * settings.steps

    def best(work: Callable[[], object]) -> float:
        taken = []
        for _ in range(ROUNDS):
            begin = time.perf_counter()
            work()
            taken.append(time.perf_counter() - begin)
        return 1e9 * min(taken) / steps

    parts = {"collection": best(lambda: rollouts.collect(driver))}
    batch = rollouts.collect(driver)
    parts["advantages"] = best(lambda: update.advantages(batch.clone()))
    samples = update.advantages(batch)
    parts["one_pass"] = best(lambda: update(samples, 1e-4, generator))
    torch.set_num_threads(threads)
    total = sum(parts.values())
    for name, taken in parts.items():
        print(f"  {name:<12} {taken:7.0f} ns a step of an agent, {100.0 * taken / total:3.0f} %")
    print(f"  together {1e3 / total:.2f} million steps a second, one core, one pass of updates")
    rounded = {name: round(taken, 1) for name, taken in parts.items()}
    return {**rounded, "million_steps_per_second": round(1e3 / total, 3)}
