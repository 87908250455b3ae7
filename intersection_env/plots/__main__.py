"""The command `python -m intersection_env.plots`: draws a map."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from intersection_env.command import run_command
from intersection_env.maps.intersection import Intersection
from intersection_env.plots.files import SUFFIXES, check_figure, write_figure
from intersection_env.plots.map_plot import plot_map


def main(arguments: Sequence[str] | None = None) -> int:
    """Draws a map into a file and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m intersection_env.plots", description="Draws a map.")
    parser.add_argument("map", help="a shipped map's name, or the path of a .json (source) or .map (compiled)")
    parser.add_argument("--out", type=Path, required=True, help=f"the file to write ({', '.join(SUFFIXES)})")
    options = parser.parse_args(arguments)
    try:
        check_figure(options.out)
        axes = plot_map(Intersection.load(options.map))
        figure: Any = axes.figure
        write_figure(figure, options.out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written: {options.out}")
    return 0


if __name__ == "__main__":
    run_command(main)
