"""A training as a command: an exit status, and a last line that says what was written or why not."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import TracebackType

import torch

from agents.training.interrupt import Interrupted

FAILED = 1
"""The exit status for wrong files and settings."""


class Command:
    """Within it, wrong files and settings, Ctrl-C and SIGTERM end in a line and a `status` instead of a trace.

    with Command(settings.run / "ppo.policy") as command:
        ...  # trains, and writes that file
    return command.status
    """

    def __init__(self, output: Path) -> None:
        """A command that writes a file."""
        self.output, self.status = output, 0

    def __enter__(self) -> Command:
        torch.set_num_threads(1)  # networks as small as the paper's gain nothing from more
        self._begin = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool:
        if error is None:
            print(f"written: {self.output}, in {time.perf_counter() - self._begin:.0f} s")
        elif isinstance(error, Interrupted):
            print(f"interrupted; --resume goes on from {self.output.parent}", file=sys.stderr)
            self.status = error.status
        elif isinstance(error, OSError | ValueError):
            print(f"error: {error}", file=sys.stderr)
            self.status = FAILED
        return self.status != 0
