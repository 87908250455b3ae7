"""The results files that `make reproduce` leaves, one a measurement."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

RESULTS = (
    "gap_development", "gap_validation", "order_development", "order_validation", "horizon_development",
    "horizon_validation", "replay_development", "maneuvers_validation", "closed_loop", "runtime", "reproduced",
)  # fmt: skip
OPTIONAL = ("ablations",)


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
