"""What all figures look like: colours, and axes without a frame on a quiet grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, RED, QUIET, GRID = "#2f6da8", "#b5483a", "#8a8a86", "#e4e4e1"


def set_style(axes: Axes) -> None:
    """Takes the frame's upper and right side away, and draws the grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=GRID, linewidth=0.6)
