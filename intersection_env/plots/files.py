"""Pictures into files: whole or not at all, and the same picture as the same bytes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from intersection_env.files import check_writable, written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
DOTS_PER_INCH = 112


def write_figure(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG, SVG or PDF; at no moment is there half a file under that name.

    Raises:
        ValueError: another kind of file.
        OSError: the file cannot be written.
    """
    check_figure(path)
    with written_whole(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=DOTS_PER_INCH, metadata=_undated(path.suffix))


def check_figure(path: Path) -> None:
    """Refuses what could not be written in the end, before the picture is made.

    Raises:
        ValueError: another kind of file.
        OSError: the file cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise ValueError(f'a picture must end in {", ".join(SUFFIXES)}, not "{path}"')
    check_writable(path)


def _undated(suffix: str) -> dict[str, Any]:
    """Metadata without a date: the same picture gives the same bytes."""
    return {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[suffix]
