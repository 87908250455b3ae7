"""Where things lie in the checkout."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "data" / "recordings"
MAPS = ROOT / "intersection_env" / "maps"
