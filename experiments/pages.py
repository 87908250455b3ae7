"""Fills the marked blocks of the README from the results files: no figure enters a page by hand.

python -m experiments.pages (`make pages` first makes the results anew)
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "experiments" / "results"
HORIZONS = (2.0, 4.0, 6.0, 8.0, 10.0)
MODELS = {"constant_velocity": "constant velocity", "idm": "IDM", "gap": "gap network, IDM"}


def errors_table(errors: pd.DataFrame) -> str:
    """Markdown of the errors over the horizon, vehicles recorded at the start and at the horizon."""
    recorded = errors[errors["population"] == "recorded"].set_index(["model", "horizon"]).to_dict("index")
    heads = [f"{name}: RMSE / MAD [m], time loss RMSE [s]" for name in MODELS.values()]
    lines = [f"| horizon [s] | {' | '.join(heads)} | samples |", "|---" * (len(heads) + 2) + "|"]
    for horizon in HORIZONS:
        rows = [recorded[model, horizon] for model in MODELS]
        cells = [f"{row['rmse']:.1f} / {row['mad']:.1f}, {row['time_loss_rmse']:.1f}" for row in rows]
        lines.append(f"| {horizon:.0f} | {' | '.join(cells)} | {rows[0]['count']:.0f} |")
    return "\n".join(lines)


def speed_table(bench: dict[str, dict[str, dict[str, dict[str, float]]]]) -> str:
    """Markdown of microseconds a scenario by kernel and driver."""
    scenarios = ("1", "64", "1024", "1024_with_distances")
    heads = ("1 scenario", "64", "1024", "1024, with smallest distances")
    lines = [f"| kernel | driver | {' | '.join(heads)} |", "|---" * (len(heads) + 2) + "|"]
    for isa, drivers in bench["predict_us"].items():
        for driver, row in drivers.items():
            cells = " | ".join(f"{row[n]:.1f}" for n in scenarios)
            lines.append(f"| {isa} | {driver} | {cells} |")
    return "\n".join(lines)


def gap_table(results: dict[str, Any]) -> str:
    """Markdown of how often gaps are decided rightly, and by how much the network leads, per foe definition."""
    heads = [f"{name} {foes}" for foes in results["foes"] for name in ("accuracy,", "network minus it,")]
    lines = [f"| | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for model in results["foes"]["recorded"]["models"]:
        cells = []
        for part in results["foes"].values():
            found = part["models"][model]
            lead = found.get("network_minus")
            cells += [_percent(found["accuracy"]), _percent(lead["accuracy"]) if lead else ""]
        lines.append(f"| {model} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _percent(interval: dict[str, float]) -> str:
    value, low, high = (100.0 * interval[key] for key in ("value", "low", "high"))
    return f"{value:.1f} [{low:.1f}, {high:.1f}]"


def filled(page: str, blocks: dict[str, str]) -> str:
    """The page with each block's text between `<!-- begin NAME -->` and `<!-- end NAME -->`.

    Raises:
        ValueError: the page lacks a block's marks.
    """
    for name, text in blocks.items():
        pattern = re.compile(rf"(<!-- begin {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
        page, found = pattern.subn(lambda mark, text=text: f"{mark[1]}{text}\n{mark[2]}", page)  # type: ignore[misc]
        if found != 1:
            raise ValueError(f'the page must hold one block "{name}", not {found}')
    return page


def readme() -> str:
    """The README as the results files make it."""
    errors = pd.read_csv(RESULTS / "errors.csv")
    bench = json.loads((RESULTS / "bench.json").read_text(encoding="utf-8"))
    gap = json.loads((RESULTS / "gap_validation.json").read_text(encoding="utf-8"))
    blocks = {"errors": errors_table(errors), "gap": gap_table(gap), "speed": speed_table(bench)}
    return filled((ROOT / "README.md").read_text(encoding="utf-8"), blocks)


def main() -> None:
    """Rewrites the README's blocks."""
    (ROOT / "README.md").write_text(readme(), encoding="utf-8")
    print("README.md is as the results say")


if __name__ == "__main__":
    main()
