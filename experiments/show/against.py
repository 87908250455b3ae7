"""Shows how the speed compares with another revision's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.tables import markdown_table

ISA = "isa "


def against_table(found: Mapping[str, Any]) -> str:
    """Time or memory now, to the other revision's, by kernel; what names no kernel ran with the last, the best."""
    timed = [one for one in found["rows"] if "ratio" in one]
    kernels = list(dict.fromkeys(word for one in timed for word in one["row"].split(", ") if word.startswith(ISA)))
    cells: dict[str, dict[str, str]] = {}
    for one in timed:
        words = one["row"].split(", ")
        kernel = next((word for word in words if word in kernels), kernels[-1])
        ratio = f"{one['ratio']:.2f}"
        if one["least"] != one["most"]:
            ratio += f" ({one['least']:.2f} to {one['most']:.2f})"
        cells.setdefault(", ".join(word for word in words if word not in kernels), {})[kernel] = ratio
    heads = (f"now to {found['revision'][:7]}", *(kernel.removeprefix(ISA) for kernel in kernels))
    return markdown_table(heads, [(what, *(row.get(kernel) for kernel in kernels)) for what, row in cells.items()])
