"""The collector of a training, by itself or with its worlds shared among Ray workers.

python -m agents.ppo fast --run runs/ppo --workers 4

Workers do not change what comes out: every world has its own random stream, so a training's bytes are the same with any
number of them, and a run may be resumed with another one. (Machines with other instruction sets may round otherwise, as
ever.) On one machine they seldom pay: the core collects an epoch faster than two workers can send it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from torchrl.collectors import BaseCollector

from agents.networks.driving import Driver
from agents.rollouts.collector import RolloutCollector
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from agents.training.ray import ray_for


def shares(worlds: int, count: int) -> list[int]:
    """So many worlds in so many shares, the first ones larger by one where they cannot be equal.

    Raises:
        ValueError: no shares, or fewer worlds than shares.
    """
    if not 1 <= count <= worlds:
        raise ValueError(f"{worlds} worlds cannot be shared by {count}")
    each, more = divmod(worlds, count)
    return [each + (place < more) for place in range(count)]


@contextmanager
def rollout_collector(
    make: Callable[..., list[ClosedLoopEnv] | list[ReplayEnv]],
    driver: Driver,
    *,
    worlds: int,
    steps: int,
    epochs: int,
    seed: int,
    threads: int = 0,
    workers: int = 0,
) -> Iterator[BaseCollector]:
    """The collector of a training, a batch an epoch; call its `update_policy_weights_()` when the driver has changed.

    Args:
        make: makes environments, given `threads` and how many `worlds` they have in all, in shares as of `shares`.
        driver: what drives.
        worlds: in all.
        steps: of each world in an epoch.
        epochs: after which it ends.
        seed: of the worlds.
        threads: that step the worlds, 0: one a core. Each worker has so many, and takes as many cores; there, 0: one.
        workers: Ray workers that share the worlds; 0: none, a `RolloutCollector` here.

    Raises:
        ValueError: workers that cannot share so many worlds, or more than Ray has cores for; Ray is not installed.
        ChildProcessError: a worker failed.
    """
    envs = make(worlds=worlds, threads=threads)
    if workers < 0 or (workers and worlds % (workers * len(envs))):
        of = f"of each of {len(envs)} environments " if len(envs) > 1 else ""
        share = f"{worlds / len(envs):g}"
        raise ValueError(f"workers is {workers}; wanted a number by which {share} worlds {of}can be divided, or 0")
    frames = sum(env.worlds.action.size for env in envs) * steps
    whole = RolloutCollector(envs, driver, frames_per_batch=frames, total_frames=frames * epochs)
    whole.set_seed(seed)
    with contextlib.ExitStack() as after:
        after.callback(whole.shutdown)
        if workers == 0:
            yield whole
            return
        cores = max(threads, 1)
        there = int(after.enter_context(ray_for("workers")).cluster_resources().get("CPU", 0))
        if there < workers * cores:
            raise ValueError(f"workers is {workers}, which take {workers * cores} cores; Ray has {there}")
        from agents.rollouts.remote import RemoteRollouts  # needs Ray

        shared = RemoteRollouts(
            partial(make, worlds=worlds // workers, threads=cores),
            driver,
            frames_per_batch=frames,
            total_frames=frames * epochs,
            workers=workers,
            cores=cores,
            environments=len(envs),
        )
        after.callback(shared.shutdown)
        shared.load_state_dict(whole.state_dict())
        yield shared
