"""The table of ratios beside another revision."""

from __future__ import annotations

from experiments.show.against import against_table


def test_each_row_has_a_ratio_a_kernel_and_memory_that_of_the_best() -> None:
    rows = [
        {"row": "replay, worlds 64, isa v3", "then": 2.0, "now": 1.0, "ratio": 0.5, "least": 0.4, "most": 0.6},
        {"row": "replay, worlds 64, isa v4", "then": 2.0, "now": 1.5, "ratio": 0.75, "least": 0.7, "most": 0.8},
        {"row": "same trajectories, isa v4, of replay", "equal": True},
        {"row": "memory, of replay", "then": 10.0, "now": 7.0, "ratio": 0.7, "least": 0.7, "most": 0.7},
    ]
    assert against_table({"revision": "9b4ae97bd", "rows": rows}).splitlines() == [
        "| now to 9b4ae97 | v3 | v4 |",
        "|---|---|---|",
        "| replay, worlds 64 | 0.50 (0.40 to 0.60) | 0.75 (0.70 to 0.80) |",
        "| memory, of replay | | 0.70 |",
    ]
