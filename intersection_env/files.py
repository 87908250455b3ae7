"""Writing files whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """A temporary file beside `path` that takes its name once the block has ended without error.

    Raises:
        OSError: the file cannot be written; what was there before is then untouched.
    """
    path = Path(path)
    check_writable(path)
    name = ""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
        os.close(handle)
        yield Path(name)
        with open(name, "rb") as file:
            os.fsync(file.fileno())
        os.chmod(name, 0o644)  # mkstemp gives 0600
        os.replace(name, path)
    except BaseException as error:
        if name:
            os.unlink(name)
        if isinstance(error, OSError) and error.errno is not None:
            raise OSError(f"{path} cannot be written: {error.strerror}") from error
        raise


def check_writable(*paths: str | Path) -> None:
    """Refuses what could not be written in the end, before the work is done.

    Raises:
        OSError: a path is no file but something else, or its folder is none, or may not be written to.
    """
    for path in map(Path, paths):
        if path.exists() and not path.is_file():
            raise OSError(f"{path} cannot be written: it is there, and no file")
        folder = next(one for one in (path.absolute().parents) if one.exists())
        if not folder.is_dir():
            raise OSError(f"{path} cannot be written: {folder} is no folder")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OSError(f"{path} cannot be written: nothing may be written into {folder}")
