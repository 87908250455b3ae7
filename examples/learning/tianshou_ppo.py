"""PPO of Tianshou in the replay: one agent among recorded vehicles.

pip install . "tianshou>=2" torch
python examples/learning/tianshou_ppo.py

Observations and rewards are scaled on the way, as its networks and its value loss like them.
"""

# /// script
# dependencies = ["intersection_env", "tianshou>=2", "torch"]
# ///

from __future__ import annotations

import argparse
from typing import Any

import gymnasium
import torch
from gymnasium.wrappers import RescaleObservation, TransformReward
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, CollectStats, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Distribution, Independent, Normal

REWARD_SCALE = 0.01  # a collision costs 5000, a step in good order pays 2
WORLDS, STEPS_AN_EPOCH = 8, 10_000
EPISODES = 100  # of a measurement


def make() -> gymnasium.Env[Any, Any]:
    """The replay with observations in [-1, 1] and smaller rewards."""
    environment = gymnasium.make("intersection_env:intersection_env/Replay-v0")
    return TransformReward(RescaleObservation(environment, -1.0, 1.0), lambda reward: REWARD_SCALE * reward)


def distribution(parameters: tuple[torch.Tensor, torch.Tensor]) -> Distribution:
    """Of the action, before it is clipped."""
    return Independent(Normal(*parameters), 1)


def algorithm(space: gymnasium.spaces.Box) -> PPO:
    """PPO with networks of its own for actor and critic."""
    actor_body, critic_body = (
        Net(state_shape=(12,), hidden_sizes=(64, 64), activation=torch.nn.Tanh) for _ in range(2)
    )
    policy = ProbabilisticActorPolicy(
        actor=ContinuousActorProbabilistic(preprocess_net=actor_body, action_shape=(1,)),
        dist_fn=distribution,
        action_space=space,
        deterministic_eval=True,
    )
    critic = ContinuousCritic(preprocess_net=critic_body)
    return PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3), gamma=0.98, max_grad_norm=0.5)


def main() -> None:
    """Trains, and prints the mean return before and after."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--epochs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.manual_seed(options.seed)
    torch.set_num_threads(1)  # such small networks gain nothing from more
    worlds, others = DummyVectorEnv([make] * WORLDS), DummyVectorEnv([make])
    worlds.seed(options.seed)
    others.seed(options.seed + WORLDS)
    ppo = algorithm(make().action_space)
    training = Collector[CollectStats](ppo, worlds, VectorReplayBuffer(4096, WORLDS))
    judging = Collector[CollectStats](ppo, others)

    def measured() -> float:
        judging.reset()
        return float(judging.collect(n_episode=EPISODES).returns.mean()) / REWARD_SCALE

    print(f"before: return {measured():9.1f} an episode", flush=True)
    parameters = OnPolicyTrainerParams(
        training_collector=training,
        test_collector=None,
        max_epochs=options.epochs,
        epoch_num_steps=STEPS_AN_EPOCH,
        collection_step_num_env_steps=2048,
        update_step_num_repetitions=5,
        batch_size=256,
        show_progress=False,
        verbose=False,
    )
    ppo.run_training(parameters)
    print(f"after:  return {measured():9.1f} an episode")


if __name__ == "__main__":
    main()
