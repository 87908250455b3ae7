"""Reads a CSV file with stated columns and types, fast when it is sound, naming the cell when it is not."""

from __future__ import annotations

import codecs
import lzma
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def read_table(path: Path, columns: Mapping[str, type]) -> pd.DataFrame:
    """The named columns of a file, `.csv` or `.csv.xz`, at least one row; other columns are ignored.

    Raises:
        ValueError: the file is damaged, lacks a column, or holds a cell that is empty or of another
            type; the message names file, line (the header is line 1) and column.
    """
    import pandas as pd  # 0.4 s to import

    content = _content(path)
    names = _header(path, content, columns)
    # pandas drops surplus cells in silence when it reads only some columns
    if content.count(b",") != (len(names) - 1) * (content.count(b"\n") + (not content.endswith(b"\n"))):
        _name_bad_cell(path, content, columns, names)
    dtypes: dict[str, Any] = {name: object if kind is str else kind for name, kind in columns.items()}
    try:
        table = pd.read_csv(
            BytesIO(content),
            dtype=dtypes,
            usecols=list(columns),
            index_col=False,
            keep_default_na=False,
            na_values=[""],
        )
    except (ValueError, OverflowError) as error:  # ParserError is a ValueError
        _name_bad_cell(path, content, columns, names)
        raise ValueError(f"{path}: damaged or truncated: {error}") from None
    if table.empty:
        raise ValueError(f"{path}: no rows of data, only a header")
    numbers = [name for name, kind in columns.items() if kind is not str]
    finite = all(bool(np.isfinite(table[name].to_numpy()).all()) for name in numbers)
    if not finite or bool(table.isna().any(axis=None)):
        _name_bad_cell(path, content, columns, names)
        raise ValueError(f"{path}: a cell is empty or not finite")
    return table


def one_of(folder: Path, name: str) -> Path:
    """The file of that name in a folder, or the one compressed as `.xz`.

    Raises:
        FileNotFoundError: neither is there.
        ValueError: both are.
    """
    found = [path for path in (folder / name, folder / f"{name}.xz") if path.is_file()]
    if not found:
        raise FileNotFoundError(f"{folder / name}: missing, and {name}.xz too; a recording needs one of the two")
    if len(found) > 1:
        raise ValueError(f"{found[0]}: {name}.xz is there as well; keep one of the two")
    return found[0]


def _content(path: Path) -> bytes:
    content = path.read_bytes()
    if path.suffix == ".xz":
        try:
            with lzma.open(BytesIO(content)) as file:
                content = file.read()
        except (lzma.LZMAError, EOFError) as error:
            raise ValueError(f"{path}: damaged or truncated: {error}") from None
    return content.removeprefix(codecs.BOM_UTF8)  # spreadsheets write one


def _header(path: Path, content: bytes, columns: Mapping[str, type]) -> list[str]:
    first = content.partition(b"\n")[0].rstrip(b"\r")
    if not first:
        raise ValueError(f"{path}: empty; wanted a header with {', '.join(columns)}")
    if not first.isascii() or not first.decode("ascii").isprintable():
        raise ValueError(f"{path}, line 1: no header of a CSV file; is it damaged or truncated?")
    names = first.decode("ascii").split(",")
    for name in columns:
        if name not in names:
            raise ValueError(f'{path}, line 1: column "{name}" is missing; the file has {", ".join(names)}')
        if names.count(name) > 1:
            raise ValueError(f'{path}, line 1: column "{name}" is there {names.count(name)} times')
    return names


def _name_bad_cell(path: Path, content: bytes, columns: Mapping[str, type], names: list[str]) -> None:
    """Goes through a refused file line by line, and raises at the first cell that is to blame."""
    wanted = [(name, names.index(name), kind) for name, kind in columns.items()]
    for line, text in enumerate(content.split(b"\n"), start=1):
        cells = text.rstrip(b"\r").decode("utf-8", errors="replace").split(",")
        if line > 1 and cells != [""]:
            _check_row(f"{path}, line {line}", cells, len(names), wanted)


def _check_row(where: str, cells: list[str], width: int, wanted: list[tuple[str, int, type]]) -> None:
    if len(cells) != width:
        raise ValueError(f"{where}: {len(cells)} cells, the header has {width} (is the file truncated?)")
    for name, index, kind in wanted:
        cell = cells[index].strip()
        try:
            sound = bool(cell) if kind is str else bool(np.isfinite(kind(cell)))
        except (ValueError, OverflowError):
            sound = False
        if not sound:
            what = "a word" if kind is str else "a whole number" if kind is np.int64 else "a finite number"
            raise ValueError(f'{where}, column "{name}": "{cell}"; wanted {what}')
