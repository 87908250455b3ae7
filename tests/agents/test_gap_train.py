"""The gap network's training: a planted rule is learned, and the policy that ships came of it."""

from __future__ import annotations

import torch

from agents.gap.train import GapSettings, train_network
from intersection_env import Predictor
from intersection_env.policies.file import PolicyFile
from tests.support.gap_samples import planted
from tests.support.paths import PACKAGE

QUICK = GapSettings(epochs=120, batch=512, noise=0.0, calibrate=False)
FOE_SPEED = (3.0, 15.0)  # [m/s]


def test_planted_rule_is_learned_to_99_percent() -> None:
    train, development, held_out = (planted(count, seed, FOE_SPEED) for seed, count in enumerate((6000, 500, 3000)))
    network = train_network(train, development, QUICK, progress=False)
    with torch.no_grad():
        accepts = network(torch.from_numpy(held_out.features)).numpy() > 0
    assert (held_out.decide(accepts) == held_out.labels()).mean() >= 0.99


def test_shipped_gap_policy_says_where_it_comes_from() -> None:
    policy = PolicyFile.read(PACKAGE / "policies" / "gap.policy")
    assert policy.about["made_by"] == "python -m agents.gap"
    assert policy.about["development"]["recorded"]["accuracy"] > 0.9
    assert Predictor.load("gap").policy.driver == "idm"
