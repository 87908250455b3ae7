"""libsumo started in this process, with files of its own, and ended again."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def running_sumo(command: Callable[[Path], Sequence[str]]) -> Iterator[Any]:
    """The library, running while the context lasts.

    command: writes SUMO's files into the folder that it is given, which goes with the context, and says how to start.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        RuntimeError: it is already running in this process.
    """
    sumo = libsumo()
    with tempfile.TemporaryDirectory() as folder:
        sumo.start(list(command(Path(folder))))
        try:
            yield sumo
        finally:
            sumo.close()


def libsumo() -> Any:
    """The library, not yet started in this process.

    Raises:
        ModuleNotFoundError: it is not installed.
        RuntimeError: it is already running here.
    """
    try:
        library = importlib.import_module("libsumo")
    except ModuleNotFoundError:
        raise ModuleNotFoundError("sumo is not installed: pip install -e '.[sumo]'") from None
    if library.isLoaded():
        raise RuntimeError("libsumo is already running in this process, and there can be only one")
    return library
