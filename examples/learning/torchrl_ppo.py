"""PPO with TorchRL's parts in the replay: collector, advantages and loss, on a vector of worlds that the core steps.

pip install . "torchrl>=0.14"
python examples/learning/torchrl_ppo.py

TorchRL takes vectors that start anew within a step (`autoreset_mode="SameStep"`).
"""

# /// script
# dependencies = ["intersection_env", "torchrl>=0.14"]
# ///

from __future__ import annotations

import argparse

import gymnasium
import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import Compose, GymWrapper, ObservationNorm, RewardScaling, RewardSum, TransformedEnv
from torchrl.modules import MLP, NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

ID = "intersection_env:intersection_env/Replay-v0"
WORLDS, STEPS = 64, 128  # of a rollout
GAMMA, TRACE = 0.98, 0.95
PASSES, MINIBATCHES, LEARNING_RATE = 5, 8, 1e-3
REWARD_SCALE = 0.01  # a collision costs 5000, a step in good order pays 2


def environment() -> TransformedEnv:
    """The vector of replays with observations in [-1, 1] by their bounds, and smaller rewards."""
    worlds = gymnasium.make_vec(ID, num_envs=WORLDS, autoreset_mode="SameStep")
    space = worlds.single_observation_space
    scale = 1.0 / torch.maximum(torch.from_numpy(space.low).abs(), torch.from_numpy(space.high).abs())
    transforms = (
        ObservationNorm(loc=torch.zeros(12), scale=scale, in_keys=["observation"]),
        RewardScaling(0.0, REWARD_SCALE),
        RewardSum(),
    )
    return TransformedEnv(GymWrapper(worlds), Compose(*transforms))


def networks(worlds: TransformedEnv) -> tuple[ProbabilisticActor, ValueOperator]:
    """Actor and critic."""
    layers = {"in_features": 12, "num_cells": [64, 64], "activation_class": nn.Tanh}
    head = nn.Sequential(MLP(out_features=2, **layers), NormalParamExtractor())
    actor = ProbabilisticActor(
        TensorDictModule(head, ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"],
        spec=worlds.full_action_spec,
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    return actor, ValueOperator(MLP(out_features=1, **layers), in_keys=["observation"])


def main() -> None:
    """Trains, and prints the mean return of the episodes that ended in each tenth of the training."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)  # such small networks gain nothing from more
    worlds = environment()
    worlds.set_seed(options.seed)
    actor, critic = networks(worlds)
    frames = WORLDS * STEPS
    collector = Collector(worlds, actor, frames_per_batch=frames, total_frames=frames * options.iterations)
    advantage = GAE(gamma=GAMMA, lmbda=TRACE, value_network=critic)
    loss = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_bonus=False)
    optimizer = torch.optim.Adam(loss.parameters(), LEARNING_RATE, eps=1e-5)
    ended: list[float] = []
    for iteration, batch in enumerate(collector, 1):
        with torch.no_grad():
            advantage(batch)
        ended += batch["next", "episode_reward"][batch["next", "done"]].tolist()
        samples = batch.reshape(-1)
        for _ in range(PASSES):
            for part in samples[torch.randperm(len(samples))].chunk(MINIBATCHES):
                terms = loss(part)
                optimizer.zero_grad()
                (terms["loss_objective"] + terms["loss_critic"]).backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimizer.step()
        if iteration % max(1, options.iterations // 10) == 0:
            mean = sum(ended) / len(ended) / REWARD_SCALE
            print(f"{iteration:3d}: return {mean:9.1f} of {len(ended)} episodes", flush=True)
            ended.clear()
    collector.shutdown()


if __name__ == "__main__":
    main()
