"""The command `python -m data.maps`: a Lanelet2 or CommonRoad map to a map source.

python -m data.maps FILE --out X.json --around x,y,radius
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.formats.commonroad_tree import PROTOBUF, XML
from data.formats.folder import read_recording, recording_ids
from data.maps.commonroad_file import read_commonroad
from data.maps.junction import MOST_RADIUS, Circle
from data.maps.lanelet2_file import read_lanelet2
from data.maps.lanelets import LaneMap
from data.maps.place import on_lanes, shift_to
from data.maps.source_of import Imported, source_of
from data.source_text import source_text
from intersection_env.command import run_command
from intersection_env.files import check_writable, written_whole
from intersection_env.maps.compiler import compile_file
from intersection_env.maps.name import check_name
from intersection_env.maps.source_values import LARGEST, check_locations

ENOUGH = 0.6  # ours: where so many cars drive on lanes already, the map lies where it should
READ = 3  # ours: so many recordings show where a map lies


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the map source, prints what was guessed and left out, and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m data.maps", description="A map of lanes to a map source.")
    parser.add_argument("file", type=Path, help="a Lanelet2 map (.osm), or a CommonRoad map or scenario (.xml, .pb)")
    parser.add_argument("--out", type=Path, required=True, help="the map source to write (.json)")
    parser.add_argument("--name", help="of the new map, one word; by default the name of --out")
    parser.add_argument(
        "--around", metavar="X,Y,RADIUS", help="the junction, in local metres; needed where there are several"
    )
    parser.add_argument(
        "--origin", metavar="EAST,NORTH", help="UTM metres of the local 0,0 (Lanelet2; inD: x/yUtmOrigin)"
    )
    parser.add_argument("--shift", metavar="EAST,NORTH", help="moves the map by so much [m]")
    parser.add_argument("--recordings", type=Path, help="moves the map to where the cars of this folder drive")
    parser.add_argument(
        "--locations", nargs="+", type=int, default=[], help="inD's ids of the place, for its recordings"
    )
    options = parser.parse_args(arguments)
    try:
        if options.out.suffix != ".json":
            raise ValueError(f'--out must end in .json, not "{options.out}"')
        check_writable(options.out)
        name = check_name(options.out.stem if options.name is None else options.name)
        check_locations(options.locations)
        around = None if options.around is None else _circle(options.around)
        lane_map = _read(options.file, options.origin)
        if options.shift is not None:
            lane_map = lane_map.shifted(*_pair("--shift", options.shift))
        if options.recordings is not None:
            lane_map = _placed(lane_map, options.recordings)
        _check_metres(options.file, lane_map)
        imported = source_of(lane_map, name, around, options.locations)
        about = f"From {options.file.name} (python -m data.maps), around {imported.circle}; {lane_map.origin}."
        with written_whole(options.out) as temporary:
            temporary.write_text(source_text(imported.content(about)), encoding="utf-8")
            _check_written(temporary, options.out)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(report(imported, lane_map))
    print(f"written: {options.out} (look at it: python -m intersection_env.plots {options.out} --out map.png)")
    return 0


def _check_written(written: Path, out: Path) -> None:
    """Reads and compiles the source as everybody will; errors name the file that was asked for."""
    try:
        compile_file(written)
    except ValueError as error:
        raise ValueError(str(error).replace(str(written), str(out))) from None


def report(imported: Imported, lane_map: LaneMap) -> str:
    """What was imported, what is guessed and what was left out, as text."""
    source = imported.source
    lines = [f"junction around {imported.circle} (--around); metres: {lane_map.origin}"]
    for name, arm in source.arms.items():
        into = sorted({route.approach[-1] for route in source.routes if route.entry == name})
        out = sorted({route.leaving[0] for route in source.routes if route.exit == name})
        limit = f"{3.6 * arm.speed_limit:.0f} km/h"
        lines.append(f"  arm {name:<4} {arm.right_of_way:<9} {limit:>9}   in: {' '.join(into)}   out: {' '.join(out)}")
    lines.append(f"  routes: {' '.join(route.id for route in source.routes)}")
    lines.append("guessed or changed, please check:" if imported.guessed else "nothing guessed")
    lines += [f"  {one}" for one in imported.guessed]
    if imported.counts:
        lines.append("left out, by reason:")
        lines += [f"  {why:<76} {count:5d}" for why, count in sorted(imported.counts.items())]
    return "\n".join(lines)


def _read(path: Path, origin: str | None) -> LaneMap:
    if path.suffix == ".osm":
        return read_lanelet2(path, None if origin is None else _pair("--origin", origin))
    if path.suffix not in (XML, PROTOBUF):
        raise ValueError(f"{path}: wanted a Lanelet2 map (.osm) or a CommonRoad file (.xml, .pb)")
    if origin is not None:
        raise ValueError(f"--origin is for Lanelet2 maps; {path.name} is in metres already (--shift moves it)")
    return read_commonroad(path)


def _placed(lane_map: LaneMap, folder: Path) -> LaneMap:
    """The map where it is if most cars drive on its lanes, else where they do."""
    recordings = [read_recording(folder, id) for id in recording_ids(folder)[:READ]]
    if on_lanes(lane_map, recordings) >= ENOUGH:
        return lane_map
    east, north, share = shift_to(lane_map, recordings)
    print(
        f"moved by {east:.2f}, {north:.2f} m (--shift): then {100 * share:.0f} % of the cars drive on lanes of their"
        " heading"
    )
    return lane_map.shifted(east, north)


def _check_metres(path: Path, lane_map: LaneMap) -> None:
    points = np.concatenate(list(lane_map.points()))
    centre = np.median(points, axis=0)
    size = np.ptp(points, axis=0).max()
    if size < 1.0:
        raise ValueError(f"{path}: the map is {size:g} m across; is it in degrees? Wanted metres")
    if np.abs(centre).max() > LARGEST:
        raise ValueError(
            f"{path}: the map lies around [{centre[0]:.0f}, {centre[1]:.0f}], {np.linalg.norm(centre) / 1e3:.1f} km"
            f" from 0; wanted local metres, at most {LARGEST:g} (--origin or --shift, as of the recordings)"
        )


def _circle(text: str) -> Circle:
    x, y, radius = _numbers("--around", text, 3)
    circle = Circle(x, y, radius)
    if not 0.0 < circle.radius <= MOST_RADIUS:
        raise ValueError(f"--around: a radius of {circle.radius:g} m; wanted more than 0 and at most {MOST_RADIUS:g}")
    return circle


def _pair(option: str, text: str) -> tuple[float, float]:
    east, north = _numbers(option, text, 2)
    return east, north


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(one) for one in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f'{option}: "{text}"; wanted {count} numbers with commas between')
    return values


if __name__ == "__main__":
    run_command(main)
