"""Keeps the headline figures under a name, with their commit: what later work is measured against.

python -m experiments.report.baseline stand-in-2      after `make reproduce` and a commit of what it left
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.report.headlines import headlines
from experiments.results_files import results_in, write_result
from experiments.show.tables import markdown_table
from intersection_env.command import run_command

RESULTS = Path("experiments/results")
BASELINES = "baselines.json"


def keep(name: str, folder: Path, commit: str) -> None:
    """Adds the figures of a folder's results files to its baselines, under a name that is not there yet.

    Raises:
        ValueError: the name is taken, or a results file is not JSON.
        OSError: a file cannot be read or written.
    """
    kept = baselines_in(folder)
    if name in kept:
        raise ValueError(f'{folder / BASELINES} holds a baseline "{name}" already')
    figures = {row.what: row.ours for row in headlines(results_in(folder))}
    write_result(folder / BASELINES, kept | {name: {"commit": commit, "figures": figures}})


def baselines_in(folder: Path) -> dict[str, Any]:
    """By name "commit" and "figures", text by what is measured; empty if none was kept."""
    path = folder / BASELINES
    kept: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return kept


def baselines_table(kept: Mapping[str, Any], results: Mapping[str, Any]) -> str:
    """The kept figures, and what they are now."""
    now = {row.what: row.ours for row in headlines(results)}
    names = list(kept)
    whats = dict.fromkeys([*now, *(what for one in kept.values() for what in one["figures"])])
    heads = ("figure", *(f"{name} ({kept[name]['commit'][:7]})" for name in names), "now")
    rows = [(what, *(kept[name]["figures"].get(what, "") for name in names), now.get(what, "")) for what in whats]
    return markdown_table(heads, rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Keeps the figures that ship; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m experiments.report.baseline", description="Keeps the figures.")
    parser.add_argument("name", help="of the baseline, as stand-in-2")
    parser.add_argument("--results", type=Path, default=RESULTS, help="the folder of the results files")
    options = parser.parse_args(arguments)
    try:
        found = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
        keep(options.name, options.results, found.stdout.strip())
    except (OSError, ValueError, subprocess.CalledProcessError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f'kept as "{options.name}" in {options.results / BASELINES}')
    return 0


if __name__ == "__main__":
    run_command(main)
