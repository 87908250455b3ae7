"""Several seeds of a training side by side, as Ray tasks.

python -m agents.ppo fast --run runs/ppo --seeds 0 1 2

Each does what it would do alone, in its own folder RUN/seed_0, RUN/seed_1, ...
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import sys
from collections.abc import Callable
from typing import Any

from tqdm import tqdm

from agents.training.command import FAILED
from agents.training.folder import METRICS, last_row
from agents.training.interrupt import SIGNALED, told_to_end
from agents.training.ray import ray_for

WATCH_EVERY = 1.0  # [s]


def train_seeds(main: Callable[[Any], int], settings: Any) -> int:
    """Trains once for each of `settings.seeds`, each a Ray task that takes one core, or as many as `settings.threads`.

    What a seed prints is shown when it has ended; one that fails does not end the others. Ctrl-C and SIGTERM end all at
    their next whole epoch.

    Args:
        main: the trainer's; returns its exit status.
        settings: the trainer's; it may have neither `threads` nor `workers`.

    Returns:
        The exit status: 0, 1 if a seed failed, 130 after Ctrl-C, 143 after SIGTERM.
    """
    if getattr(settings, "workers", 0):
        print("error: --seeds and --workers do not go together", file=sys.stderr)
        return FAILED
    has_threads = hasattr(settings, "threads")
    cores = max(settings.threads, 1) if has_threads else 1
    common = {"seeds": (), **({"threads": cores} if has_threads else {})}
    alone = {
        seed: dataclasses.replace(settings, seed=seed, run=settings.run.absolute() / f"seed_{seed}", **common)
        for seed in settings.seeds
    }
    try:
        with ray_for("seeds") as ray:
            task = ray.remote(num_cpus=cores, max_retries=0)(_train)
            return _watch(ray, {seed: task.remote(main, one, os.getcwd()) for seed, one in alone.items()}, alone)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return FAILED


def _train(main: Callable[[Any], int], settings: Any, folder: str) -> tuple[int, str]:
    """A trainer's exit status and what it printed, from the folder where it was called."""
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status = main(settings)
    return status, printed.getvalue()


def _watch(ray: Any, tasks: dict[int, Any], settings: dict[int, Any]) -> int:
    """Shows a bar a seed until all have ended; returns the exit status of all."""
    status, signal_number = 0, None
    with contextlib.ExitStack() as after:
        told = after.enter_context(told_to_end())
        bars = {
            seed: after.enter_context(
                tqdm(total=settings[seed].epochs, desc=f"seed {seed}", position=position, disable=None, unit="epoch")
            )
            for position, seed in enumerate(tasks)
        }
        while tasks:
            ended, _ = ray.wait(list(tasks.values()), timeout=WATCH_EVERY)
            if signal_number is None and (signal_number := told()) is not None:
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
    return status if signal_number is None else SIGNALED + signal_number


def _ended(ray: Any, task: Any) -> tuple[bool, str]:
    """Whether a task failed, and what is to be said about it."""
    try:
        status, printed = ray.get(task)
    except ray.exceptions.TaskCancelledError:
        return True, "interrupted; --resume goes on"
    except ray.exceptions.RayError as error:
        return True, f"failed: {error}"
    return status != 0, printed
