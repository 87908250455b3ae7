"""The epochs of a training: which are left, metrics and checkpoints, signals that end them, what falls over them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any, Protocol, TypeAlias

import torch
from tqdm import tqdm

from agents.training.folder import RunFolder
from agents.training.interrupt import Interrupted, told_to_end

PROJECTED_FROM = 5  # epochs


class Stateful(Protocol):
    """A network, an optimizer, a collector: what can be set to a state that it had."""

    def state_dict(self) -> Any: ...

    def load_state_dict(self, state_dict: Any, /) -> Any: ...


Part: TypeAlias = Stateful | torch.Generator | dict[str, Any]
"""One of the things that a checkpoint holds; a dict has plain values and is filled in place."""


class Epochs:
    """The epochs of a training, counted from 1; those that the folder's checkpoint has seen are not done again.

        with Epochs("PPO", 300, folder, 50) as epochs:
            epochs.resume(driver=driver, optimizer=optimizer, generator=generator)
            for epoch in epochs:
                row = ...  # learns, and says how it went
                if epochs.is_due:
                    row |= ...  # looks closer, as a checkpoint follows
                epochs.end(row)

    Within it, Ctrl-C and SIGTERM wait for the end of the epoch under way.
    """

    def __init__(
        self, name: str, count: int, folder: RunFolder | None, checkpoint_every: int, progress: bool = True
    ) -> None:
        """Epochs that are not begun.

        Args:
            name: of the training, for its bar.
            count: of epochs in all.
            folder: where metrics and checkpoints go.
            checkpoint_every: epochs; the last one has a checkpoint too.
            progress: whether to show a bar.
        """
        self.count, self.epoch = count, 0
        self._name, self._folder, self._every, self._progress = name, folder, checkpoint_every, progress
        self._parts: dict[str, Part] = {}
        self._within = contextlib.ExitStack()

    def __enter__(self) -> Epochs:
        self._told = self._within.enter_context(told_to_end())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._within.close()

    def resume(self, **parts: Part) -> None:
        """Sets the parts as the folder's checkpoint has them, if there is one; its checkpoints hold these parts.

        Raises:
            ValueError: the checkpoint is damaged.
        """
        self._parts = parts
        state = self._folder.load() if self._folder else None
        if state is not None:
            for name, part in parts.items():
                _restore(part, state[name])
            self.epoch = int(state["epoch"])
        if self._folder and self._folder.resume:
            goes_on = f"goes on after epoch {self.epoch} of {self.count}"
            print(
                f"--resume {self._folder.path}: {goes_on if state else 'no checkpoint there yet: begins anew'}",
                flush=True,
            )

    def __iter__(self) -> Iterator[int]:
        bar = tqdm(
            total=self.count,
            initial=self.epoch,
            desc=self._name,
            disable=None if self._progress else True,
            unit="epoch",
        )
        self._bar = self._within.enter_context(bar)
        self._first, self._begin = self.epoch, time.perf_counter()
        while self.epoch < self.count:
            self.epoch += 1
            yield self.epoch

    @property
    def share(self) -> float:
        """How far the training is: 0 in the first epoch, 1 in the last."""
        return (self.epoch - 1) / max(self.count - 1, 1)

    @property
    def is_due(self) -> bool:
        """Whether this epoch ends with a checkpoint, signals aside."""
        return self.epoch == self.count or self.epoch % self._every == 0

    def show(self, **figures: str) -> None:
        """Shows figures beside the bar."""
        self._bar.set_postfix(figures)

    def end(self, row: Mapping[str, Any]) -> None:
        """Ends the epoch: adds its row to the metrics, and a checkpoint if that is due.

        Raises:
            Interrupted: Ctrl-C or SIGTERM came; the checkpoint is of this epoch.
            OSError: a file cannot be written.
        """
        signal_number = self._told()
        self._bar.update()
        if self._progress and self.epoch == self._first + PROJECTED_FROM:
            left = self.count - self._first
            hours = left * (time.perf_counter() - self._begin) / PROJECTED_FROM / 3600.0
            self._bar.write(f"{left} epochs at this rate: {hours:.2f} h")
        if self._folder:
            self._folder.append({"epoch": self.epoch, **row})
            if self.is_due or signal_number is not None:
                states = {name: _state_of(part) for name, part in self._parts.items()}
                self._folder.save({"epoch": self.epoch, **states})
        if signal_number is not None and self.epoch < self.count:
            raise Interrupted(signal_number)


def linear(first: float, last: float, share: float) -> float:
    """From first to last by equal differences."""
    return first + share * (last - first)


def geometric(first: float, last: float, share: float) -> float:
    """From first to last by equal ratios."""
    ratio: float = (last / first) ** share
    return first * ratio


def _state_of(part: Part) -> Any:
    if isinstance(part, torch.Generator):
        return part.get_state()
    return part if isinstance(part, dict) else part.state_dict()


def _restore(part: Part, state: Any) -> None:
    if isinstance(part, torch.Generator):
        part.set_state(state)
    elif isinstance(part, dict):
        part.clear()
        part.update(state)
    else:
        part.load_state_dict(state)
