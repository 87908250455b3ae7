"""Where things lie in the checkout."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "intersection_env"
MAPS = PACKAGE / "maps"
RECORDINGS = ROOT / "data" / "recordings"
