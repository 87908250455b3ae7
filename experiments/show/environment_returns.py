"""What drivers are paid in the environments, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.show.tables import markdown_table


def returns_table(results: Mapping[str, Any]) -> str:
    """A line an environment, a column a driver: return with half the interval's width, and steps."""
    variants = results["variants"]
    drivers = list(next(iter(variants.values())))
    rows = [(f"`{name}`", *(_cell(found[driver]) for driver in drivers)) for name, found in variants.items()]
    return markdown_table(("environment", *drivers), rows)


def _cell(found: Mapping[str, Any]) -> str:
    paid = found["return"]
    return f"{paid['value']:,.0f} ± {0.5 * (paid['high'] - paid['low']):,.0f} ({found['steps']:,.0f})"
