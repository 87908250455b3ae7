"""The command `python -m data.align`: a map's lanes to where recorded cars drive.

python -m data.align MAP RECORDINGS --out MAP
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from data.align.align import LEAST_CARS, align
from data.align.picture import plot_alignment
from data.align.report import report
from data.align.source_file import write_source
from data.build import recordings_on
from data.formats.folder import read_recording
from intersection_env.command import run_command
from intersection_env.files import check_writable
from intersection_env.maps.intersection import MAPS, Intersection, shipped_maps
from intersection_env.maps.name import check_name
from intersection_env.maps.source import MapSource
from intersection_env.plots.files import check_figure, write_figure

ABOUT = "Lanes moved to where recorded cars drive (python -m data.align): traced, under the recordings' licence."
NOTE = "traced from recordings: what their licence says of them holds for this map and its picture, too"


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the moved map and a picture, prints the deviations, and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m data.align", description="Lanes to where recorded cars drive.")
    parser.add_argument("map", help="a shipped map's name, or the path of a source .json")
    parser.add_argument("folder", type=Path, help="folder with recordings of inD, INTERACTION or CommonRoad")
    parser.add_argument("--out", type=Path, required=True, help="the map source to write (.json)")
    parser.add_argument("--name", help="of the new map, one word; by default NAME_aligned")
    parser.add_argument("--picture", type=Path, help="the picture to write; by default a .png beside --out")
    parser.add_argument(
        "--least-cars", type=int, default=LEAST_CARS, help=f"lanes with fewer cars stay (default: {LEAST_CARS})"
    )
    options = parser.parse_args(arguments)
    try:
        path = source_path(options.map)
        if options.out.suffix != ".json":
            raise ValueError(f'--out must end in .json, not "{options.out}"')
        picture = options.picture or options.out.with_suffix(".png")
        check_writable(options.out)
        check_figure(picture)
        name = None if options.name is None else check_name(options.name)
        source, before = MapSource.read(path), Intersection.load(options.map)
        on_map, _ = recordings_on(options.folder, before)
        recordings = [read_recording(options.folder, id) for id in on_map]
        alignment = align(source, before, recordings, options.least_cars)
        write_source(path, alignment.source, options.out, name or f"{source.name}_aligned", ABOUT)
        write_figure(plot_alignment(alignment), picture)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(report(alignment))
    print(f"written: {options.out}, {picture} ({NOTE})")
    return 0


def source_path(name_or_path: str) -> Path:
    """The source file of a shipped map, or the file of that path.

    Raises:
        ValueError: neither.
    """
    path = Path(name_or_path)
    if path.suffix == ".json":
        return path
    if name_or_path not in shipped_maps():
        known = ", ".join(shipped_maps())
        raise ValueError(f'no map "{name_or_path}" ships (there are {known}); a file must end in .json')
    return MAPS / f"{name_or_path}.json"


if __name__ == "__main__":
    run_command(main)
