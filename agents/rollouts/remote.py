"""A collector whose worlds Ray workers share out among them; importing this needs Ray."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import ray
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.collectors.distributed import RayCollector

from agents.networks.driving import Driver
from agents.rollouts.collector import RolloutCollector
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv


@contextmanager
def _workers_errors() -> Iterator[None]:
    try:
        yield
    except ray.exceptions.RayError as error:
        raise ChildProcessError(f"a Ray worker failed: {error}") from error


class RemoteRollouts(RayCollector):  # type: ignore[misc]  # TorchRL is untyped
    """TorchRL's collector over Ray, of `RolloutCollector`s: batches and state are those of one with all the worlds."""

    def __init__(
        self,
        make: Callable[[], list[ClosedLoopEnv] | list[ReplayEnv]],
        driver: Driver,
        *,
        frames_per_batch: int,
        total_frames: int,
        workers: int,
        cores: int,
        environments: int,
    ) -> None:
        """Starts the workers, which then need a state.

        Args:
            make: makes the worlds of one worker.
            driver: what drives; `update_policy_weights_()` tells the workers how it is now.
            frames_per_batch, total_frames: of all workers together.
            workers: how many.
            cores: that each worker takes.
            environments: how many `make` makes, equally large ones.

        Raises:
            ChildProcessError: a worker failed, as for all methods.
        """
        self.environments = environments
        with _workers_errors():
            super().__init__(
                [make] * workers,
                driver,
                collector_class=RolloutCollector,
                frames_per_batch=frames_per_batch,
                total_frames=total_frames,
                sync=True,
                postproc=partial(_batch, environments=environments),
                weight_sync_schemes={},  # weights are few: they go by a call, without a process group beside Ray
                remote_configs={"num_cpus": cores, "num_gpus": 0},
            )
        self.requested_frames_per_batch = frames_per_batch
        self.update_policy_weights_()

    def __del__(self) -> None:
        """Nothing: workers end with their last handle; TorchRL kills them here, for which it may start Ray anew."""

    def iterator(self) -> Iterator[TensorDictBase]:
        """Batches as of `Rollouts.collect`, each in its own memory."""
        with _workers_errors():
            yield from super().iterator()

    @_workers_errors()
    def state_dict(self) -> OrderedDict[str, Any]:
        """As of one `RolloutCollector` with all the worlds."""
        states = super().state_dict()
        parts = [state["env_state_dict"] for state in states]
        whole = OrderedDict(
            (name, _in_one_row(torch.stack([part[name] for part in parts]), self.environments)) for name in parts[0]
        )
        return OrderedDict(
            policy_state_dict=states[0]["policy_state_dict"],
            env_state_dict=whole,
            frames=sum(state["frames"] for state in states),
            iter=states[0]["iter"],
        )

    @_workers_errors()
    def load_state_dict(self, state_dict: OrderedDict[str, Any], strict: bool = True) -> None:
        """Goes on where `state_dict` was taken, with however many workers."""
        self.policy.load_state_dict(state_dict["policy_state_dict"], strict=strict)
        self.collected_frames = state_dict["frames"]
        share = {"frames": state_dict["frames"] // self.num_workers}
        worlds = {
            # the same with the parts swapped: environments come first in the whole, workers in the shares
            name: _in_one_row(whole.unflatten(0, (self.environments, -1)), self.num_workers).chunk(self.num_workers)
            for name, whole in state_dict["env_state_dict"].items()
        }
        super().load_state_dict(
            [
                # clones, as a view would be sent with all that it is a view of
                {**state_dict, **share, "env_state_dict": {name: part[i].clone() for name, part in worlds.items()}}
                for i in range(self.num_workers)
            ]
        )

    @_workers_errors()
    def _maybe_fallback_update(self, policy_or_weights: Any = None, *, model_id: str | None = None) -> None:
        weights = TensorDict.from_module(self.policy) if policy_or_weights is None else policy_or_weights
        self.map_fn("update_policy_weights_", [(weights.data,)] * self.num_workers)


def _in_one_row(parts: Any, inner: int) -> Any:
    """(outer, inner * n, ...) to (inner * outer * n, ...): what all have of the first inner one comes first."""
    count = parts.shape[1] // inner
    return parts.unflatten(1, (inner, count)).transpose(0, 1).flatten(0, 2)


def _batch(parts: TensorDictBase, environments: int) -> TensorDictBase:
    """(worker, world, ...) to (world, ...)."""
    joined: TensorDictBase = _in_one_row(parts, environments)
    joined.names = parts.names[1:]
    return joined
