"""What the tests of the trainers share: small scenes, runs that are killed, and runs whose disk is full."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from agents.training.folder import CHECKPOINT, METRICS, RunFolder, state_hash
from intersection_env import Scenes
from intersection_env.policies.file import PolicyFile
from tests.support.damage import with_checksum

PATIENCE = 120.0  # [s]


def small_scenes(*splits: str) -> Scenes:
    """The first scenes that ship of each of these splits."""
    scenes = Scenes.load("bendplatz")
    return replace(scenes, scenes=tuple(scene for split in splits for scene in scenes.select(split).scenes[:3]))


def outcome(run: Path) -> tuple[str, bytes]:
    """What two runs must share to be the same: the checkpoint's hash and the metrics."""
    return state_hash(torch.load(run / CHECKPOINT, weights_only=True)), (run / METRICS).read_bytes()


def cut_short(run: Path) -> bytes:
    """Cuts the checkpoint in half; what is left."""
    content = (run / CHECKPOINT).read_bytes()
    (run / CHECKPOINT).write_bytes(content[: len(content) // 2])
    return content[: len(content) // 2]


def killed(main: Callable[[Any], int], settings: Any, kills: int = 3) -> None:
    """Runs a training in processes of its own and kills each at a random moment after its first checkpoint.

    The processes are forked off a server that has loaded the trainers, as loading takes longer than training.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.agents.test_ppo", "tests.imitation.test_gail"])
    generator = np.random.default_rng()
    checkpoint = settings.run / CHECKPOINT
    for _ in range(kills):
        before = checkpoint.stat().st_mtime_ns if checkpoint.exists() else 0
        process = context.Process(target=main, args=(replace(settings, resume=True),))
        process.start()
        end = time.monotonic() + PATIENCE
        while not checkpoint.exists() or checkpoint.stat().st_mtime_ns == before:
            assert process.is_alive(), "the training ended before its first checkpoint"
            assert time.monotonic() < end, "no checkpoint comes"
            time.sleep(0.002)
        time.sleep(float(generator.uniform(0.0, 0.1)))
        process.kill()
        process.join()
        assert process.exitcode == -9, "the training was over before it was killed"


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """Within it, no file grows beyond so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def with_other_feature(policy: PolicyFile, path: Path) -> Path:
    """Writes the policy as one whose gap network takes its speed in another unit."""
    body = policy.text()
    body = body[: body.rindex("checksum ")].replace("yielder_speed_mps", "yielder_speed_kmh")
    path.write_text(with_checksum(body), encoding="utf-8")
    return path


def files(folder: RunFolder | Path) -> set[str]:
    """The names of what a run folder holds."""
    return {path.name for path in (folder.path if isinstance(folder, RunFolder) else folder).iterdir()}
