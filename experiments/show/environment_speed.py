"""Shows how fast the environments are, beside others, and training in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.tables import markdown_table


def environments_section(environments: Mapping[str, Any]) -> str:
    """The tables, what a frame takes, and how steady the machine was."""
    machine, frame = environments["reference_gflops"], environments["frame_ms"]["median"]
    rates = ", ".join(f"{found['median']:.0f}" for found in machine)
    shares = ", ".join(f"{100.0 * found['core_share']:.0f}" for found in machine)
    notes = (
        f"A frame of 600 x 600 pixels takes {frame:.1f} ms to render. For comparing machines: before the first table,\n"
        f"before the peers and after them a product of 256 x 256 float32 matrices in one thread ran at {rates}\n"
        f"GFLOP/s, with {shares} % of a core to itself; the rest went to others, which slows everything else alike."
    )
    return "\n\n".join((worlds_table(environments), threads_table(environments), doors_table(environments), notes))


def worlds_table(environments: Mapping[str, Any]) -> str:
    """The batched worlds' agent-steps a second, by kernel, and how often worlds ended meanwhile."""
    columns = list(environments["worlds"][0]["rates"])
    rows = []
    for row in environments["worlds"]:
        rates = (f"{row['rates'][column]['median'] / 1e6:.1f}" for column in columns)
        rows.append((row["name"], *rates, f"{100.0 * row['ends_per_world_step']:.1f} %"))
    return markdown_table(("million agent-steps/s", *columns, "worlds that end with a step"), rows)


def threads_table(environments: Mapping[str, Any]) -> str:
    """What a second thread is worth, by how much there is to share."""
    rows = [
        (row["name"], f"{row['median']:.2f} ({row['least']:.2f} to {row['most']:.2f})")
        for row in environments["threads"]
    ]
    return markdown_table(("rate with two threads, over that with one, in turns", "median (least to most)"), rows)


def doors_table(environments: Mapping[str, Any]) -> str:
    """The doors' agent-steps a second, and the peers', which may be missing."""
    rows: list[tuple[str | None, ...]]
    rows = [(row["name"], _thousands(row["rate"]["median"]), None) for row in environments["doors"]]
    for row in environments["peers"]:
        rows.append((row["name"], row.get("missing") or _thousands(row["rate"]["median"]), row.get("doing", "")))
    return markdown_table(("one process, one core", "thousand agent-steps/s", None), rows)


def _thousands(rate: float) -> str:
    return f"{rate / 1e3:.0f}" if rate >= 1e4 else f"{rate / 1e3:.2f}"


def training_sentence(training: Mapping[str, float]) -> str:
    """Where an epoch's time goes."""
    parts = {name: training[name] for name in ("collection", "advantages", "one_pass")}
    shares = [f"{name.replace('_', ' ')} {100.0 * taken / sum(parts.values()):.0f} %" for name, taken in parts.items()]
    return (
        f"PPO on one core: {training['million_steps_per_second']:.2f} million agent-steps/s with one pass of updates,"
        " best of five rounds\n"
        f"({', '.join(shares)})."
    )
