"""Options that commands have alike, and what their help says."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import tyro

NONE = tyro.conf.arg(help_behavior_hint="(default: none)")
Maps: TypeAlias = Annotated[tuple[str, ...], NONE]
"""Maps, none by default."""
Seeds: TypeAlias = Annotated[tuple[int, ...], NONE]
"""Seeds, none by default."""
