"""Results files: one a measurement, written whole; those that `make reproduce` leaves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from intersection_env.files import check_writable, written_whole
from intersection_env.plots.files import check_figure

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (
    "gap_development", "gap_validation", "order_development", "order_validation", "horizon_development",
    "horizon_validation", "replay_development", "replay_validation", "forecast_development", "forecast_validation",
    "perception_validation", "maneuvers_validation", "closed_loop", "places", "runtime", "default", "reproduced",
)  # fmt: skip
OPTIONAL = ("ablations", "driven_gain_validation")
DIGITS = 6  # of floats


def results_in(folder: Path) -> dict[str, Any]:
    """The contents of the results files by their names; the optional ones where they are there.

    Raises:
        OSError: a file cannot be read.
        ValueError: a file is not JSON.
    """
    names = [*RESULTS, *(name for name in OPTIONAL if (folder / f"{name}.json").exists())]
    return {name: _read(folder / f"{name}.json") for name in names}


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: not JSON: {error}") from None


def check_outputs(result: Path, figure: Path | None = None) -> None:
    """Refuses what could not be written in the end, before anything is measured.

    Raises:
        OSError: a file cannot be written.
        ValueError: a figure of a kind that is not drawn.
    """
    check_writable(result)
    if figure is not None:
        check_figure(figure)


def write_result(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a results file, floats to six digits."""
    with written_whole(path) as temporary:
        temporary.write_text(json.dumps(rounded(content)) + "\n", encoding="utf-8")


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """A table's rows as JSON holds them, None where a value is missing."""
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]


def rounded(content: Any) -> Any:
    """The same with floats to six digits."""
    if isinstance(content, Mapping):
        return {key: rounded(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [rounded(value) for value in content]
    return float(f"{content:.{DIGITS}g}") if isinstance(content, float) else content
