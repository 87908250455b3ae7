"""Rollouts with the policy inside the core, as tensordicts, by themselves or as a TorchRL collector."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torchrl.collectors import BaseCollector
from torchrl.envs.utils import ExplorationType

from agents.networks.driving import Driver
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from intersection_env.features import DRIVING_FEATURES
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds

Worlds: TypeAlias = ClosedLoopWorlds | ReplayWorlds

FLOATS = ("latent", "log_probability", "value_now", "value_next", "reward")
FLAGS = ("terminated", "cut")
RANDOM = "random"  # in the worlds' state, the one of unsigned numbers
CPU = (None, "cpu", torch.device("cpu"))
NEUTRAL: dict[str, tuple[Any, ...]] = {
    "init_random_frames": (None, 0, -1),
    "max_frames_per_traj": (None, 0, -1),
    "reset_at_each_iter": (None, False),
    "split_trajs": (None, False),
    "exploration_type": (None, ExplorationType.RANDOM),
    "device": CPU,
    "storing_device": CPU,
    "env_device": CPU,
    "policy_device": CPU,
    "trust_policy": (None, False, True),
}
"""What TorchRL's distributed collectors say to each worker's, and the values that a rollout in the core agrees with."""


class Rollouts:
    """Steps worlds, many steps a call, into two buffers in turn."""

    def __init__(self, worlds: Worlds | Sequence[Worlds], steps: int) -> None:
        """Buffers for rollouts of so many steps.

        Args:
            worlds: one batch of them, or several that differ in who decides about gaps, for instance.
            steps: of each world in a rollout.

        Raises:
            ValueError: there is less than one step, or the batches differ in their vehicles.
        """
        if steps < 1:
            raise ValueError(f"steps is {steps}; wanted at least 1")
        self.batches = list(worlds) if isinstance(worlds, Sequence) else [worlds]
        self.steps = steps
        if len({batch.action.shape[1:] for batch in self.batches}) > 1:
            raise ValueError("the batches of worlds differ in their vehicles")
        self.shape = (sum(len(batch.action) for batch in self.batches), steps, *self.batches[0].action.shape[1:])
        self._buffers = [self._buffer(), self._buffer()]

    def collect(self, driver: Driver) -> TensorDict:
        """The next steps; valid until the call after the next one, which writes into the same memory.

        (world, step, vehicle) in the closed loop, else (world, step), as TorchRL's GAE and losses name and take it:
        "observation" (12,); "action" (1,), which is before its tanh, u ~ Normal(mean, sigma); "action_log_prob" (),
        that of u; "state_value" (1,). Under "next": "reward", "done", "terminated" and "state_value" (1,). Done is
        every end of a return, reinsertions among them; there, "state_value" is that of the life's last observation.

        Raises:
            RuntimeError: the worlds have not been reset.
        """
        if not all(batch.is_reset for batch in self.batches):
            raise RuntimeError("the worlds must be reset before the first rollout")
        buffer = self._buffers.pop(0)
        self._buffers.append(buffer)
        policy, value, sigma = driver.policy.packed(), driver.value.packed(), float(driver.sigma)
        first = 0
        for batch in self.batches:
            part = slice(first, first + len(batch.action))
            arrays = {name: tensor[part].numpy() for name, tensor in buffer.items()}
            batch.core.rollout(policy, value, sigma, self.steps, **arrays)
            first = part.stop
        return self._named(buffer)

    def _buffer(self) -> dict[str, Tensor]:
        floats = {name: torch.zeros(self.shape) for name in FLOATS}
        flags = {name: torch.zeros(self.shape, dtype=torch.bool) for name in FLAGS}
        return {"observation": torch.zeros(*self.shape, len(DRIVING_FEATURES)), **floats, **flags}

    def _named(self, buffer: dict[str, Tensor]) -> TensorDict:
        rows = {name: tensor.unsqueeze(-1) for name, tensor in buffer.items()}
        following = {
            "reward": rows["reward"],
            "done": rows["cut"],
            "terminated": rows["terminated"],
            "state_value": rows["value_next"],
        }
        return TensorDict(
            {
                "observation": buffer["observation"],
                "action": rows["latent"],
                "action_log_prob": buffer["log_probability"],
                "state_value": rows["value_now"],
                "next": TensorDict(following, self.shape),
            },
            self.shape,
            names=[None, "time", *[None] * (len(self.shape) - 2)],
        )


class RolloutCollector(BaseCollector):  # type: ignore[misc]  # TorchRL is untyped
    """A TorchRL collector of `Rollouts`; its frames are steps of agents."""

    init_random_frames = 0

    def __init__(
        self,
        create_env_fn: Any,
        policy: Driver,
        *,
        frames_per_batch: int,
        total_frames: int,
        worker_idx: int | None = None,
        pre_collect_hook: Callable[[], None] | None = None,
        post_collect_hook: Callable[[TensorDictBase], None] | None = None,
        **others: Any,
    ) -> None:
        """A collector in one environment or several, which the first batch resets.

        Args:
            create_env_fn: a `ClosedLoopEnv` or `ReplayEnv`, a list of such, or what makes one or a list; the worlds
                of several stand one after the other in each batch.
            policy: what drives; read anew for each batch.
            frames_per_batch: worlds times steps times vehicles.
            total_frames: at which to stop, -1: never.
            worker_idx, pre_collect_hook, post_collect_hook: as TorchRL has them.
            others: what TorchRL's distributed collectors pass on, where it changes nothing (`NEUTRAL`).

        Raises:
            TypeError: an unknown argument, or no such environment.
            ValueError: environments that differ in their vehicles, frames that make no whole number of steps, none at
                all, or an argument that asks for what is not done here.
        """
        super().__init__(pre_collect_hook=pre_collect_hook, post_collect_hook=post_collect_hook)
        _check_neutral(others)
        self.envs = _environments(create_env_fn)
        self.policy = policy
        agents = sum(env.worlds.action.size for env in self.envs)
        if frames_per_batch < 1 or frames_per_batch % agents:
            raise ValueError(f"frames_per_batch is {frames_per_batch}; wanted a multiple of the {agents} agents")
        if total_frames < 1 and total_frames != -1:
            raise ValueError(f"total_frames is {total_frames}; wanted at least 1, or -1 for no end")
        self.frames_per_batch = self.requested_frames_per_batch = frames_per_batch
        self.total_frames = total_frames
        self.worker_idx = worker_idx
        self._rollouts = Rollouts([env.worlds for env in self.envs], frames_per_batch // agents)
        self._must_start = True
        self._frames, self._iter = 0, -1

    def __bool__(self) -> bool:
        """Always: Ray asks this of a worker that raised, and would otherwise kill it over a length that has no end."""
        return True

    def iterator(self) -> Iterator[TensorDictBase]:
        """Batches as of `Rollouts.collect`, each valid until the next but one."""
        while self.total_frames == -1 or self._frames < self.total_frames:
            if self.pre_collect_hook is not None:
                self.pre_collect_hook()
            self._start_if_due()
            batch = self._rollouts.collect(self.policy)
            self._frames += batch.numel()
            self._iter += 1
            if self.post_collect_hook is not None:
                self.post_collect_hook(batch)
            yield batch

    def set_seed(self, seed: int, static_seed: bool = False) -> int:
        """Seeds the worlds, which start anew with the next batch; returns the seed for a next collector."""
        for env in self.envs:
            seed = env.set_seed(seed, static_seed=static_seed)
        self._must_start = True
        return seed

    def state_dict(self) -> OrderedDict[str, Any]:
        """Everything that the next batches depend on; starts the worlds if that is due."""
        self._start_if_due()
        parts = [env.state() for env in self.envs]
        worlds = OrderedDict(
            (name, torch.from_numpy(_signed(np.concatenate([part[name] for part in parts])))) for name in parts[0]
        )
        return OrderedDict(
            policy_state_dict=self.policy.state_dict(), env_state_dict=worlds, frames=self._frames, iter=self._iter
        )

    def load_state_dict(self, state_dict: OrderedDict[str, Any], strict: bool = True) -> None:
        """Goes on where `state_dict` was taken."""
        self.policy.load_state_dict(state_dict["policy_state_dict"], strict=strict)
        worlds = {name: tensor.numpy() for name, tensor in state_dict["env_state_dict"].items()}
        worlds[RANDOM] = worlds[RANDOM].view(np.uint32)
        first = 0
        for env in self.envs:
            part = slice(first, first + len(env.worlds.action))
            env.set_state({name: array[part] for name, array in worlds.items()})
            first = part.stop
        self._must_start = False
        self._frames, self._iter = state_dict["frames"], state_dict["iter"]

    def shutdown(self, timeout: float | None = None, close_env: bool = True, raise_on_error: bool = True) -> None:
        """Closes the environments."""
        for env in self.envs if close_env else []:
            if not env.is_closed:
                env.close(raise_if_closed=raise_on_error)

    def _start_if_due(self) -> None:
        if self._must_start:
            for env in self.envs:
                env.reset()
            self._must_start = False

    def _maybe_fallback_update(
        self,
        policy_or_weights: Any = None,
        *,
        model_id: str | None = None,
    ) -> None:
        """What `update_policy_weights_` does without a scheme: copies the weights in, if they come from elsewhere."""
        if model_id not in (None, "policy"):
            raise KeyError(f'there is no model "{model_id}" here, only "policy"')
        if policy_or_weights is None:
            return  # the policy that was passed is the one in use
        is_module = isinstance(policy_or_weights, nn.Module)
        weights = TensorDict.from_module(policy_or_weights) if is_module else TensorDict(policy_or_weights)
        TensorDict.from_module(self.policy).data.update_(weights.data)


def _signed(array: NDArray[Any]) -> NDArray[Any]:
    """The same bits as a type that torch can pickle, which it cannot uint32."""
    return array.view(np.int32) if array.dtype == np.uint32 else array


def _environments(create: Any) -> list[ClosedLoopEnv | ReplayEnv]:
    environments: list[ClosedLoopEnv | ReplayEnv] = []
    for one in create if isinstance(create, Sequence) else [create]:
        made = one if isinstance(one, ClosedLoopEnv | ReplayEnv) or not callable(one) else one()
        environments += made if isinstance(made, Sequence) else [made]
    if not environments:
        raise TypeError("create_env_fn gives no environment")
    for environment in environments:
        if not isinstance(environment, ClosedLoopEnv | ReplayEnv):
            raise TypeError(f"create_env_fn gives {type(environment).__name__}; wanted a ClosedLoopEnv or ReplayEnv")
    return environments


def _check_neutral(arguments: dict[str, Any]) -> None:
    for name, value in arguments.items():
        if name not in NEUTRAL:
            raise TypeError(f'there is no argument "{name}"')
        if value not in NEUTRAL[name]:
            raise ValueError(f"{name} is {value!r}, which rollouts in the core do not do")
