"""A folder of recordings to a scenes file, or to one for each of several places.

python -m data.build RECORDINGS --map bendplatz --out out/scenes.npz
python -m data.build RECORDINGS --out out/scenes                        a file for each map that ships, where one lies
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from data.formats.folder import read_location, read_recording, recording_file, recording_ids
from data.pipeline.extrapolation import HORIZON
from data.pipeline.filters import CROSSING_MARGIN, OVERTAKING_MARGIN
from data.pipeline.projection import MAX_EXCESS, RMS_EXCESS
from data.pipeline.scenes_of import LEAST_DURATION, build_scenes, check_location, give_map_of
from data.pipeline.split import split_of
from intersection_env.command import run_command
from intersection_env.constants import DT
from intersection_env.files import check_writable
from intersection_env.maps.intersection import Intersection, recorded_maps
from intersection_env.scenes.scene import SPLITS, Scene
from intersection_env.scenes.scenes import Scenes

SETTINGS = {
    "rms_excess_m": RMS_EXCESS,
    "max_excess_m": MAX_EXCESS,
    "crossing_margin_s": CROSSING_MARGIN,
    "overtaking_margin_s": OVERTAKING_MARGIN,
    "extrapolation_s": HORIZON,
    "least_duration_s": LEAST_DURATION,
}


def build(
    folder: Path, intersection: Intersection, recordings: Sequence[str] | None = None, progress: bool = True
) -> Scenes:
    """The scenes of all recordings in a folder that lie on the map, or of those named ("07").

    Raises:
        FileNotFoundError: a file is missing.
        ValueError: a file is malformed, or none of the recordings, or one of those named, lies on the map.
    """
    on_map, elsewhere = recordings_on(folder, intersection)
    chosen = _chosen(folder, intersection, on_map, recordings)
    split, origin = split_of(folder, on_map)
    scenes: list[Scene] = []
    dropped: defaultdict[str, float] = defaultdict(float)
    if recordings is None:
        dropped["recordings: of another location"] = len(elsewhere)
    about = []
    for id in tqdm(chosen, desc="recordings", unit="recording", disable=None if progress else True):
        recording = read_recording(folder, id)
        own, reasons = build_scenes(recording, split[id], intersection)
        scenes += own
        for reason, count in reasons.items():
            dropped[reason] += count
        about.append(
            {
                "id": id,
                "file": recording_file(folder, id).name,
                "location": recording.location,
                "split": split[id],
                "seconds": round((int(recording.frame.max()) + 1) / recording.frame_rate, 3),
                "tracks": len(recording.track_id),
            }
        )
    provenance = {"made_by": "python -m data.build", "split": origin, "settings": SETTINGS, "recordings": about}
    counts = {reason: round(float(dropped[reason]), 1) for reason in sorted(dropped) if dropped[reason]}
    return Scenes(intersection, tuple(scenes), provenance, counts)


def recordings_on(folder: Path, intersection: Intersection) -> tuple[list[str], list[str]]:
    """The ids of the recordings in a folder that lie on the map, and of those that do not.

    Formats that name no location leave it to who chose the map; tracks far from its routes are refused later.

    Raises:
        FileNotFoundError: there is no recording.
        ValueError: none of them lies on the map.
    """
    on_map: list[str] = []
    elsewhere: list[str] = []
    locations = {id: read_location(folder, id) for id in recording_ids(folder)}
    for id, location in locations.items():
        (on_map if location is None or location in intersection.locations else elsewhere).append(id)
    if not on_map:
        check_location(elsewhere[0], locations[elsewhere[0]], intersection)
    return on_map, elsewhere


def maps_of(folder: Path, maps: Sequence[str | Path] = ()) -> tuple[Intersection, ...]:
    """The maps to build scenes on: those named, or every map that ships on which a recording of the folder lies.

    Raises:
        FileNotFoundError: there is no recording.
        ValueError: a map is damaged, none of the recordings lies on one, or two maps have one name.
        OSError: a map's file cannot be read.
    """
    found = tuple(Intersection.load(name) for name in maps or recorded_maps())
    names = [one.name for one in found]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f'two maps are called "{twice[0]}"; each needs a name of its own')
    locations = {id: read_location(folder, id) for id in recording_ids(folder)}
    places = set(locations.values())
    there = tuple(one for one in found if set(one.locations) & places or (maps and None in places))
    for one in found if maps or not there else ():
        if one not in there:
            if places == {None}:
                raise ValueError(
                    f"{folder}: these recordings name no location; give the map of their place (--map PATH)"
                )
            wanted, are = (", ".join(sorted(map(str, each - {None}))) for each in (set(one.locations), places))
            raise ValueError(
                f'map "{one.name}": no recording in {folder} lies on it: it is made for location {wanted or "none"},'
                f" the recordings are of location {are}; {give_map_of(are)}"
            )
    return there


def summary(scenes: Scenes) -> str:
    """What the scenes hold and what was dropped, as text."""
    recorded = sum(one["seconds"] for one in scenes.provenance["recordings"])
    lines = [f"{recorded / 3600.0:.2f} h recorded; split {scenes.provenance['split']}"]
    for split in SPLITS:
        part = scenes.select(split)
        hours = sum(scene.steps for scene in part) * DT / 3600.0
        tracks = len({track.id for scene in part for track in scene.tracks})
        recordings = len({scene.recording for scene in part})
        lines.append(
            f"  {split:<12} {recordings:3d} recordings {len(part):5d} scenes {hours:7.2f} h {tracks:6d} vehicles"
        )
    lines.append(f"dropped or cut, by reason (a scene lasts {LEAST_DURATION:g} s or more):")
    lines += [f"  {reason:<48} {count:10g}" for reason, count in scenes.dropped.items()]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds scenes files, prints what was dropped and why, and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m data.build", description="Recordings to a scenes file.")
    parser.add_argument("folder", type=Path, help="folder with recordings of inD, INTERACTION or CommonRoad")
    parser.add_argument(
        "--map",
        nargs="+",
        default=(),
        help="names of maps that ship, or paths of .json or .map; default: all that ship and have recordings here",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("out/scenes.npz"),
        help="the scenes file to write (.npz); or a folder, for MAP.npz of each map",
    )
    parser.add_argument("--recordings", nargs="+", metavar="NN", help="read only these (07 08 09)")
    options = parser.parse_args(arguments)
    try:
        maps = maps_of(options.folder, options.map)
        if options.out.suffix == ".npz" and len(maps) > 1:
            names = ", ".join(one.name for one in maps)
            raise ValueError(
                f"--out {options.out} is one file, and recordings lie on several maps ({names}); give a --map, or as"
                " --out a folder"
            )
        for one, wanted in _wanted_on(options.folder, maps, options.recordings):
            path = options.out if options.out.suffix == ".npz" else options.out / f"{one.name}.npz"
            check_writable(path)
            scenes = build(options.folder, one, wanted)
            if not len(scenes):
                raise ValueError(f"{options.folder}: no stretch is left to make a scene of\n{summary(scenes)}")
            scenes.save(path)
            print(f"map {one.name}: {summary(scenes)}")
            print(f"written: {path}")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _wanted_on(
    folder: Path, maps: Sequence[Intersection], wanted: Sequence[str] | None
) -> list[tuple[Intersection, list[str] | None]]:
    """The maps on which recordings that are wanted lie, and which; None stands for all. One on no map is refused."""
    if wanted is None:
        return [(one, None) for one in maps]
    placed = [(one, recordings_on(folder, one)[0]) for one in maps]
    for id in wanted:
        if not any(id in on_map for _, on_map in placed):
            _chosen(folder, *placed[0], [id])  # says what is wrong with it
    chosen = [(one, [id for id in wanted if id in on_map]) for one, on_map in placed]
    return [(one, own) for one, own in chosen if own]


def _chosen(folder: Path, intersection: Intersection, on_map: Sequence[str], wanted: Sequence[str] | None) -> list[str]:
    for id in wanted or ():
        if id not in on_map:
            present = recording_ids(folder)
            if id not in present:
                raise FileNotFoundError(f"{folder}: no recording {id} here; there are {', '.join(present)}")
            check_location(id, read_location(folder, id), intersection)
    return [id for id in on_map if wanted is None or id in wanted]


if __name__ == "__main__":
    run_command(main)
