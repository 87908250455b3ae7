"""A command's end: its exit status, and readers of its output that leave early, as `head` does."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from typing import NoReturn, TextIO


def run_command(main: Callable[[], int | None]) -> NoReturn:
    """Runs a command, and ends the process with its exit status (None: 0).

    What is printed after the reader has gone is lost, and nothing else: the command does its work to the end.
    """
    sys.stdout, sys.stderr = _unread(sys.stdout), _unread(sys.stderr)
    status = main()
    sys.exit(status or 0)


class _Output(io.FileIO):
    """A file descriptor that takes what nobody reads."""

    def write(self, data: object) -> int:
        try:
            return super().write(data)  # type: ignore[arg-type]
        except BrokenPipeError:
            return memoryview(data).nbytes  # type: ignore[arg-type]


def _unread(stream: TextIO) -> TextIO:
    try:
        stream.fileno()
    except OSError:  # a stream of Python's own, as in tests
        return stream
    raw = _Output(stream.fileno(), "w", closefd=False)
    lines = bool(getattr(stream, "line_buffering", False))
    return io.TextIOWrapper(io.BufferedWriter(raw), stream.encoding, stream.errors, line_buffering=lines)
