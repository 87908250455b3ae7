"""Ctrl-C or SIGTERM that ends a training at the next whole epoch."""

from __future__ import annotations

import signal
from types import FrameType

SIGNALED = 128
"""With the number of a signal added: the exit status that a shell gives what it ended (130: Ctrl-C, 143: SIGTERM)."""


class Interrupted(Exception):  # noqa: N818, not an error
    """A signal came; the checkpoint is written. `status` is the exit status that says so."""

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(number)
        self.status = SIGNALED + number


class told_to_end:  # noqa: N801, a context manager reads as a verb
    """Within it, the first Ctrl-C or SIGTERM is only noted, for `told()` to give; a second one ends at once."""

    def __enter__(self) -> told_to_end:
        self._number: int | None = None
        try:
            self._before = {one: signal.signal(one, self._note) for one in (signal.SIGINT, signal.SIGTERM)}
        except ValueError:  # not the main thread: no signal comes there
            self._before = {}
        return self

    def __exit__(self, *error: object) -> None:
        for one, before in self._before.items():
            signal.signal(one, before)

    def __call__(self) -> int | None:
        """The number of the signal that came."""
        return self._number

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._number = number
        for one, before in self._before.items():
            signal.signal(one, signal.default_int_handler if one == signal.SIGINT else before)
