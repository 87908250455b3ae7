"""Ctrl-C that ends a training at the next whole epoch."""

from __future__ import annotations

import signal
from types import FrameType


class Interrupted(Exception):  # noqa: N818, not an error
    """Ctrl-C came; the checkpoint is written."""


class ctrl_c:  # noqa: N801, a context manager reads as a verb
    """Within it, the first Ctrl-C only sets a flag, which `interrupted()` reads; a second one ends at once."""

    def __enter__(self) -> ctrl_c:
        self._pressed = False
        try:
            self._before = signal.signal(signal.SIGINT, self._press)
        except ValueError:  # not the main thread: nobody presses keys there
            self._before = None
        return self

    def __exit__(self, *error: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def __call__(self) -> bool:
        return self._pressed

    def _press(self, number: int, frame: FrameType | None) -> None:
        self._pressed = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
