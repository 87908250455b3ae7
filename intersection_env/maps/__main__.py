"""The command `python -m intersection_env.maps`: compiles map sources."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from intersection_env.command import run_command
from intersection_env.files import written_whole
from intersection_env.maps.compiler import compile_file
from intersection_env.maps.intersection import MAPS, Intersection


def main(arguments: Sequence[str] | None = None) -> int:
    """Compiles one source file, or, if told so, all that ship in their places; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m intersection_env.maps", description="Compiles map sources.")
    parser.add_argument("source", nargs="?", type=Path, help="a map source (.json)")
    parser.add_argument("out", nargs="?", type=Path, help="the compiled map (.map); default: beside the source")
    parser.add_argument("--shipped", action="store_true", help="all maps that ship, in their places (`make maps`)")
    options = parser.parse_args(arguments)
    if options.shipped == (options.source is not None):
        parser.error("wanted one map source, or --shipped, which writes the maps of this package anew")
    try:
        if options.out is not None and options.out.suffix != ".map":
            raise ValueError(f'"{options.out}": a compiled map ends in .map, or nothing reads it')
        for source in sorted(MAPS.glob("*.json")) if options.shipped else [options.source]:
            target = options.out or source.with_suffix(".map")
            text = compile_file(source)
            Intersection(text, str(source))  # what the core would refuse is not written
            with written_whole(target) as temporary:
                temporary.write_text(text, encoding="utf-8")
            print(f"{source} -> {target}")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    run_command(main)
