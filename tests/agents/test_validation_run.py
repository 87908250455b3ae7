"""The validation run is what steps by hand give."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.rollouts.validation_run import validation_run
from intersection_env import ClosedLoopWorlds
from intersection_env.constants import DT
from intersection_env.features import Driving

COLLISION = 5000.0


def test_validation_run_is_what_steps_by_hand_give() -> None:
    policy = DrivingNetwork()
    count, steps = 3, 230  # more than one part of a rollout, and not a whole number of them
    by_hand = ClosedLoopWorlds(worlds=count, vehicles=5)
    by_hand.reset(8, desynchronise=True)
    rewards, speeds, ends = [], [], []
    for _ in range(steps):
        speeds.append(by_hand.observation[..., Driving.SPEED].copy())
        with torch.no_grad():
            by_hand.action[:] = torch.tanh(policy(torch.from_numpy(by_hand.observation))).numpy()
        by_hand.step()
        rewards.append(by_hand.reward.astype(np.float64))
        ends.append(by_hand.terminated.copy())
    run = validation_run(policy, gap="critical_gap", seed=8, worlds=count, steps=steps, vehicles=5)
    reward, ended = np.stack(rewards), np.stack(ends)
    assert ended.sum() > 2
    assert (reward[ended] < -0.9 * COLLISION).all()
    assert run.reward == pytest.approx(reward.mean(), rel=1e-3)
    assert run.reward_between_collisions == pytest.approx(reward[~ended].mean(), rel=1e-3)
    assert run.collisions == pytest.approx(ended.mean() / DT)
    assert run.speed == pytest.approx(float(np.mean(speeds)), rel=1e-3)
    assert run.seconds == pytest.approx(count * steps * DT)
