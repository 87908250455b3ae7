"""More cores for a training, through Ray: workers that share one training's worlds, or several seeds side by side.

python -m agents.ppo fast --run runs/ppo --workers 4
python -m agents.ppo fast --run runs/ppo --seeds 0 1 2

Neither changes what comes out: every world has its own random stream, so a training's bytes are the same with any
number of workers, and a run may be resumed with another one; each seed does what it would do alone, in its own folder
RUN/seed_0, RUN/seed_1, ... (Machines with other instruction sets may round otherwise, as ever.)

Ray is connected to where the environment variable RAY_ADDRESS says, else to a cluster that was started on this machine
by `ray start`, else it is started here and ends with the training. All machines need this checkout, installed with
`pip install -e '.[train,ray]'`, and the files of the training under the same paths. A cluster that asks for a token
(Ray's default) is joined with RAY_AUTH_MODE=token, Ray's own variable.

On one machine workers seldom pay: the core collects an epoch faster than two workers can send it. Seeds do.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from torchrl.collectors import BaseCollector
from tqdm import tqdm

from agents.networks.driving import Driver
from agents.rollouts.collector import RolloutCollector
from agents.rollouts.envs import ClosedLoopEnv, ReplayEnv
from agents.training.folder import METRICS

LOCAL_RAY: dict[str, Any] = {"include_dashboard": False, "logging_level": "ERROR"}
WATCH_EVERY = 1.0  # seconds
LAST_BYTES = 4096  # of the metrics, which hold the last line


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
        make: makes environments, equally large ones, given `threads` and how many `worlds` they have in all.
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
    share = worlds // len(envs)
    if workers < 0 or share % max(workers, 1):
        raise ValueError(f"workers is {workers}; wanted a number by which {share} worlds can be divided, or 0")
    frames = sum(env.worlds.action.size for env in envs) * steps
    whole = RolloutCollector(envs, driver, frames_per_batch=frames, total_frames=frames * epochs)
    whole.set_seed(seed)
    with contextlib.ExitStack() as after:
        after.callback(whole.shutdown)
        if workers == 0:
            yield whole
            return
        cores = max(threads, 1)
        there = int(after.enter_context(_ray("workers")).cluster_resources().get("CPU", 0))
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


def train_seeds(main: Callable[[Any], int], settings: Any) -> int:
    """Trains once for each of `settings.seeds`, each a Ray task that takes one core, or as many as `settings.threads`.

    What a seed prints is shown when it has ended; one that fails does not end the others. Ctrl-C ends all at their next
    whole epoch.

    Args:
        main: the trainer's; returns its exit status.
        settings: the trainer's.

    Returns:
        The exit status: 0, 1 if a seed failed, 130 after Ctrl-C.
    """
    if settings.workers:
        print("error: --seeds and --workers do not go together", file=sys.stderr)
        return 1
    cores = max(settings.threads, 1)
    alone = {
        seed: dataclasses.replace(
            settings, seed=seed, seeds=(), threads=cores, run=settings.run.absolute() / f"seed_{seed}"
        )
        for seed in settings.seeds
    }
    try:
        with _ray("seeds") as ray:
            task = ray.remote(num_cpus=cores, max_retries=0)(_train)
            return _watch(ray, {seed: task.remote(main, one, os.getcwd()) for seed, one in alone.items()}, alone)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _train(main: Callable[[Any], int], settings: Any, folder: str) -> tuple[int, str]:
    """A trainer's exit status and what it printed, from the folder where it was called."""
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status = main(settings)
    return status, printed.getvalue()


def _watch(ray: Any, tasks: dict[int, Any], settings: dict[int, Any]) -> int:
    """Shows a bar a seed until all have ended; returns the exit status of all."""
    status, interrupted = 0, False
    with contextlib.ExitStack() as after:
        bars = {
            seed: after.enter_context(
                tqdm(total=settings[seed].epochs, desc=f"seed {seed}", position=position, disable=None, unit="epoch")
            )
            for position, seed in enumerate(tasks)
        }
        while tasks:
            try:
                ended, _ = ray.wait(list(tasks.values()), timeout=WATCH_EVERY)
            except KeyboardInterrupt:
                if interrupted:
                    raise
                ended, interrupted = [], True
                for one in tasks.values():
                    ray.cancel(one)
            for seed in list(tasks):
                row = last_row(settings[seed].run / METRICS)
                bars[seed].n = row.get("epoch", 0)
                bars[seed].set_postfix(reward=f"{row.get('reward', 0.0):.2f}")
                if tasks[seed] in ended:
                    failed, printed = _ended(ray, tasks.pop(seed))
                    tqdm.write(f"seed {seed}: {printed.strip()}", file=sys.stderr if failed else sys.stdout)
                    status = max(status, int(failed))
    return 130 if interrupted else status


def _ended(ray: Any, task: Any) -> tuple[bool, str]:
    """Whether a task failed, and what is to be said about it."""
    try:
        status, printed = ray.get(task)
    except ray.exceptions.TaskCancelledError:
        return True, "interrupted; --resume goes on"
    except ray.exceptions.RayError as error:
        return True, f"failed: {error}"
    return status != 0, printed


def last_row(metrics: Path) -> dict[str, Any]:
    """The last whole line of a metrics file, {} if there is none."""
    if not metrics.exists():
        return {}
    with metrics.open("rb") as file:
        file.seek(max(metrics.stat().st_size - LAST_BYTES, 0))
        lines = file.read().split(b"\n")
    row: dict[str, Any] = json.loads(lines[-2]) if len(lines) > 1 else {}
    return row


@contextmanager
def _ray(option: str) -> Iterator[Any]:
    """Ray, connected to or started; left on exit, if it was not connected to before."""
    try:
        import ray
    except ImportError as error:
        raise ValueError(f"{option} needs Ray, which is not installed: pip install -e '.[ray]'") from error
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init(**LOCAL_RAY)
    try:
        yield ray
    finally:
        if is_ours:
            ray.shutdown()
