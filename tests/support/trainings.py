"""The trainers with settings by which each takes a second or two, and what befalls their runs."""

from __future__ import annotations

import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import agents.gap.train
import agents.orders.train
import agents.ppo
import imitation.gail
import imitation.rollout_gradient
from agents.gap.train import GapSettings
from agents.orders.train import OrderSettings
from agents.ppo import PpoSettings
from agents.rollouts.policy_update import UpdateSettings
from agents.training.folder import CHECKPOINT, METRICS, RunFolder, decisive, state_hash
from imitation.discriminator import DiscriminatorSettings
from imitation.gail import GailSettings
from imitation.rollout_gradient import RolloutSettings
from intersection_env.policies.file import PolicyFile
from tests.support.disk import full_disk

PATIENCE = 120.0  # [s]
TINY_GAP = GapSettings(epochs=8, batch=256, checkpoint_every=3)
TINY_ORDERS = OrderSettings(epochs=8, batch=8, every=2.0, checkpoint_every=3)
TINY_PPO = PpoSettings(
    map=("bendplatz",),
    gaps=("critical_gap",),
    worlds=4,
    vehicles=6,
    steps=16,
    epochs=8,
    update=UpdateSettings(passes=1, minibatches=2),
    threads=1,
    checkpoint_every=3,
)
TINY_SHARED = PpoSettings(
    map=("bendplatz",),
    gaps=("critical_gap", "sumo"),
    worlds=4,
    vehicles=6,
    steps=16,
    epochs=4,
    checkpoint_every=3,
    threads=1,
)
"""Of worlds that two workers can share."""
TINY_GAIL = GailSettings(
    ppo=None,
    worlds=8,
    steps=16,
    epochs=8,
    value_epochs=2,
    update=UpdateSettings(passes=2, minibatches=1),
    discriminator=DiscriminatorSettings(passes=2, minibatches=1),
    threads=1,
    checkpoint_every=3,
)
TINY_ROLLOUT = RolloutSettings(
    epochs=8,
    alone_share=0.5,
    every=5.0,
    drives=64,
    moments=8,
    free_drives=40,
    checkpoint_every=3,
)


@dataclass(frozen=True)
class Trainer:
    """One of the trainers: its command, and settings for a tiny training without a run folder."""

    command: str
    main: Callable[[Any], int]
    settings: Any
    policy: str
    """The policy file that it writes into the run folder."""

    def train(self, run: Path, **others: Any) -> tuple[str, bytes, bytes]:
        """The outcome of an unbroken run."""
        assert self.main(replace(self.settings, run=run, **others)) == 0
        return self.outcome(run)

    def about(self, run: Path) -> Mapping[str, Any]:
        """What the policy says about this training; a policy with forecasts is another's but for these."""
        about = PolicyFile.read(run / self.policy).about
        of_orders: Mapping[str, Any] = about.get("orders", about)
        return of_orders if self.command == agents.orders.train.COMMAND else about

    def outcome(self, run: Path) -> tuple[str, bytes, bytes]:
        """What two runs must share to be the same: the checkpoint's hash, the metrics and the policy."""
        return *outcome(run), (run / self.policy).read_bytes()


def trainer_of(name: str, *scenes: Path, map: str | Path | None = None) -> Trainer:
    """The trainer "gap", "gap, cyclic" (its schedule), "orders", "ppo", "gail" or "rollout_gradient", on these scenes.

    map: an own map on which some of the scenes lie; PPO drives there and on Bendplatz.
    """
    maps = () if map is None else (str(map),)
    where: dict[str, Any] = {"scenes": scenes, "map": maps}
    of_gap = Trainer(agents.gap.train.COMMAND, agents.gap.train.main, replace(TINY_GAP, **where), "gap.policy")
    orders = agents.orders.train
    of_orders = Trainer(orders.COMMAND, orders.main, replace(TINY_ORDERS, **where), "orders.policy")
    of_ppo = Trainer(agents.ppo.COMMAND, agents.ppo.main, replace(TINY_PPO, map=(*TINY_PPO.map, *maps)), "ppo.policy")
    of_gail = Trainer(imitation.gail.COMMAND, imitation.gail.main, replace(TINY_GAIL, **where), "gail.policy")
    rollouts = imitation.rollout_gradient
    of_rollouts = Trainer(rollouts.COMMAND, rollouts.main, replace(TINY_ROLLOUT, **where), "rollout_gradient.policy")
    cyclic = replace(of_gap, settings=replace(of_gap.settings, schedule="cyclic"))
    trainers = {"gap": of_gap, "gap, cyclic": cyclic, "orders": of_orders}
    trainers |= {"ppo": of_ppo, "gail": of_gail, "rollout_gradient": of_rollouts}
    return trainers[name]


def train_alone(settings: PpoSettings) -> None:
    """What the command does before the runs of 2000 s."""
    folder = RunFolder.begin(settings.run, decisive(settings), "", settings.resume)
    agents.ppo.train_driver(settings, folder, progress=False)


def outcome(run: Path) -> tuple[str, bytes]:
    """The checkpoint's hash and the metrics."""
    return state_hash(torch.load(run / CHECKPOINT, weights_only=True)), (run / METRICS).read_bytes()


def refused(main: Callable[[Any], int], settings: Any, capsys: pytest.CaptureFixture[str]) -> str:
    """The error of a run that must not begin."""
    assert main(settings) == 1
    assert not settings.run.exists(), "a run that never began has a folder"
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    return error


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
    context.set_forkserver_preload(["tests.support.trainings"])
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


def terminated(main: Callable[[Any], int], settings: Any) -> int | None:
    """Runs a training in a process of its own and sends it SIGTERM after its first epoch; the exit status."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.support.trainings"])
    process = context.Process(target=_exit_with, args=(main, settings))
    process.start()
    end = time.monotonic() + PATIENCE
    while not (settings.run / METRICS).exists():
        assert process.is_alive(), "the training ended before its first epoch"
        assert time.monotonic() < end, "no epoch ends"
        time.sleep(0.002)
    process.terminate()
    process.join()
    return process.exitcode


def _exit_with(main: Callable[[Any], int], settings: Any) -> None:
    sys.exit(main(settings))


@contextmanager
def told_to_end_after(epoch: int, number: signal.Signals = signal.SIGINT) -> Iterator[None]:
    """Within it, a signal (Ctrl-C) comes when the metrics of this epoch have been written."""
    through = RunFolder.append

    def tell(self: RunFolder, row: Mapping[str, Any]) -> None:
        through(self, row)
        if row["epoch"] == epoch:
            signal.raise_signal(number)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "append", tell)
        yield


@contextmanager
def disk_full_from(epoch: int) -> Iterator[None]:
    """Within it, no checkpoint of this epoch or a later one fits on the disk."""
    through = RunFolder.save

    def fill(self: RunFolder, state: Mapping[str, Any]) -> None:
        if state["epoch"] < epoch:
            return through(self, state)
        with full_disk(8192):
            return through(self, state)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "save", fill)
        yield


def files(run: Path) -> set[str]:
    """The names of what a run folder holds."""
    return {path.name for path in run.iterdir()}
