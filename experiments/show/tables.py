"""Tables in Markdown, and figures with their intervals as these stand in cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


def markdown_table(heads: Sequence[str | None], rows: Iterable[Sequence[str | None]], rule: str = "---") -> str:
    """A table; None leaves a cell blank. Under each head stands `rule`."""
    return "\n".join((_line(heads), f"|{rule}" * len(heads) + "|", *map(_line, rows)))


def _line(cells: Sequence[str | None]) -> str:
    return "".join("| " if cell is None else f"| {cell} " for cell in cells) + "|"


def in_unit(found: Mapping[str, float] | None, unit: str = "", form: str = ".2f") -> str:
    """A figure with its interval in brackets; nothing where there is none."""
    if found is None:
        return ""
    return f"{found['value']:{form}} [{found['low']:{form}}, {found['high']:{form}}] {unit}".rstrip()


def in_percent(found: Mapping[str, float] | None, unit: str = "") -> str:
    """A share, likewise, in percent."""
    percent = None if found is None else {key: 100.0 * found[key] for key in ("value", "low", "high")}
    return in_unit(percent, unit, ".1f")
