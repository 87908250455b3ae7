"""Stand-in recordings: SUMO traffic on the maps that ship, written as inD writes its recordings.

`python -m data.sumo` regenerates every shipped recording, to the same uncompressed bytes. The traffic
is simulated; nothing in it stems from a camera. Positions follow from SUMO's positions along its lanes
and our own centrelines, so a vehicle's centre lies on its route, except while it passes a bicycle.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from data.sumo import demand as sumo_demand
from data.sumo import drive as sumo_drive
from data.sumo import network as sumo_network
from data.sumo import recording_files as sumo_files
from data.sumo import tracks as sumo_tracks
from data.sumo.larger import larger as larger_place
from data.sumo.network import Network
from data.sumo.places import NUMBERS, PLACES, Place, place_of
from data.sumo.tracks import FRAME_RATE, Track
from intersection_env.files import check_writable
from intersection_env.maps.source import MapSource
from intersection_env.scenes.scene import SPLITS

RECORDINGS = Path(__file__).parents[1] / "recordings"
DURATION, WARM_UP = 720.0, 60.0  # [s]
MOST = 4.0  # ours: times as different, or as large, as usual
SEED, REDRAW = 20100, 1000  # recording NN has seed SEED + NN, plus REDRAW for every time it is drawn again


def main(arguments: Sequence[str] | None = None) -> int:
    """Regenerates the recordings; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m data.sumo", description=__doc__)
    parser.add_argument("--recording", type=int, choices=NUMBERS, help="only this one, without settings.json")
    parser.add_argument("--output", type=Path, default=RECORDINGS, help="folder to write to")
    parser.add_argument(
        "--wider", type=float, default=1.0, help="times as different drivers as usual; needs another --output"
    )
    parser.add_argument(
        "--larger", type=float, default=1.0, help="times as large places, whose maps are written, too; likewise"
    )
    options = parser.parse_args(arguments)
    for name, times in (("--wider", options.wider), ("--larger", options.larger)):
        if not 1.0 <= times <= MOST:
            parser.error(f"{name} must be from 1 to {MOST:g}, not {times:g}")
        if times > 1.0 and options.output.resolve() == RECORDINGS:
            parser.error(f"{name} needs an --output of its own, so that the recordings that ship stay as they are")
    numbers = NUMBERS if options.recording is None else [options.recording]
    try:
        check_writable(options.output / "settings.json")
        seeds = {
            number: generate(number, options.output, options.wider, options.larger)
            for number in tqdm(numbers, unit="recording")
        }
        if options.recording is None:
            sumo_files.write_settings(options.output, _made_with(seeds, options.wider, options.larger))
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def generate(number: int, folder: Path, wider: float = 1.0, larger: float = 1.0) -> list[int]:
    """Write one recording's files; the seeds tried, the last without vehicles that collide or overlap.

    wider: times as different drivers as usual, and a pace of each recording's own. larger: times as large a place, as
    of `larger`, whose map is written, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    place = place_of(number)
    if larger > 1.0:
        place = larger_place(place, larger, folder)
    source, network = sumo_network.read(place.source)
    seeds, tracks = [SEED + number], None
    while (tracks := draw(place, source, network, seeds[-1], wider)) is None:
        seeds.append(seeds[-1] + REDRAW)
    sumo_files.write_recording(folder, number, place.location, tracks, DURATION)
    return seeds


def draw(place: Place, source: MapSource, network: Network, seed: int, wider: float = 1.0) -> list[Track] | None:
    """The tracks under a seed, in order of appearance; None if vehicles collide or overlap."""
    temper = sumo_demand.wider(np.random.default_rng([seed, 1]), wider)
    rng = np.random.default_rng(seed)
    drivers = sumo_demand.draw_drivers(rng, place, sumo_demand.streams_of(source), WARM_UP + DURATION, temper)
    driven = sumo_drive.simulate(network, drivers, seed, WARM_UP, DURATION, sumo_demand.main_arms(source))
    if driven is None:
        return None
    frames = round(DURATION * FRAME_RATE)
    tracks = []
    for motion in driven:
        path = network.paths[motion.driver.route]
        seen = sumo_tracks.track(motion, path, sumo_tracks.view_of(source, path, place.view), frames)
        tracks += [] if seen is None else [seen]
    if sumo_tracks.overlaps(tracks):
        return None
    tracks += sumo_tracks.walks(rng, source, tracks, frames)
    return sorted(tracks, key=lambda one: one.first_frame)


def _made_with(seeds: dict[int, list[int]], wider: float, larger: float) -> dict[str, object]:
    changed = [f" --{name} {times:g}" for name, times in (("wider", wider), ("larger", larger)) if times > 1.0]
    return {
        "made_by": "python -m data.sumo" + "".join(changed),
        "maps": {place.map: [f"{number:02d}" for number in place.recordings] for place in PLACES},
        "split": {name: [f"{number:02d}" for place in PLACES for number in place.numbers[name]] for name in SPLITS},
        "seeds": {f"{number:02d}": tried[-1] for number, tried in seeds.items()},
        "redraw_reason": "vehicles collided or overlapped under the seeds listed",
        "redrawn": {f"{number:02d}": tried[:-1] for number, tried in seeds.items() if len(tried) > 1},
    }
