"""Writes small recordings in inD's format, with vehicles that drive exactly on a map's routes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from intersection_env.maps.intersection import Intersection, Sample

FRAME_RATE = 25.0
# track, route, position and speed at the start; the first lets the others pass
MOVERS = {
    "bendplatz": [(1, "NW-NE", 100.0, 3.5), (2, "SE-NW", 80.0, 7.0), (3, "SE-NW", 100.0, 7.0)],
    "t_junction": [(1, "S-W", 65.0, 3.0), (2, "W-E", 95.0, 7.0), (3, "W-E", 115.0, 7.0)],
}
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mover:
    """One recorded track: a first frame, then a position per frame; (frame, 2) [m]."""

    track: int
    road_user: str
    first_frame: int
    centre: Floats
    length: float = 4.5
    width: float = 1.8
    heading: float | None = None
    """[rad]; by default the way that it moves."""


def on_route(
    intersection: Intersection,
    route: str,
    track: int,
    begin: float,
    arc_length: Callable[[Floats], Floats],
    seconds: float,
    road_user: str = "car",
    aside: float = 0.0,
) -> Mover:
    """A vehicle at `arc_length(t)` for t in [0, seconds], from `begin` [s], `aside` metres to the left."""
    time = np.arange(round(seconds * FRAME_RATE) + 1) / FRAME_RATE
    s = arc_length(time)
    samples = intersection.routes[intersection.route_index(route)].samples.astype(np.float64)
    grid = np.arange(len(samples))
    x, y, heading = (np.interp(s, grid, samples[:, column]) for column in (Sample.X, Sample.Y, Sample.HEADING))
    centre = np.stack([x - aside * np.sin(heading), y + aside * np.cos(heading)], axis=1)
    size = (0.0, 0.0) if road_user == "bicycle" else (4.5, 1.8)
    return Mover(track, road_user, round(begin * FRAME_RATE), centre, *size)


def steady(position: float, speed: float) -> Callable[[Floats], Floats]:
    """Arc length over time at constant speed."""
    return lambda time: position + speed * time


def standing(
    intersection: Intersection,
    route: str,
    track: int,
    position: float,
    begin: float,
    seconds: float,
    aside: float = 0.0,
    turned: float = 0.0,
) -> Mover:
    """A car that stands at an arc length, `aside` metres to the left and `turned` radians off the lane's heading."""
    spot = on_route(intersection, route, track, begin, steady(position, 0.0), seconds, aside=aside)
    index = intersection.route_index(route)
    heading = float(intersection.sample(index, np.array([position], np.float32))[0, Sample.HEADING])
    return replace(spot, heading=heading + turned)


def walking(track: int, begin: float, start: Sequence[float], end: Sequence[float], seconds: float) -> Mover:
    """A pedestrian on a straight line."""
    share = np.linspace(0.0, 1.0, round(seconds * FRAME_RATE) + 1)[:, None]
    centre = (1.0 - share) * np.array(start) + share * np.array(end)
    return Mover(track, "pedestrian", round(begin * FRAME_RATE), centre, 0.0, 0.0)


def write_recording(
    folder: Path,
    id: str,
    movers: Sequence[Mover],
    location: int = 1,
    seconds: float | None = None,
    suffix: str = ".csv",
) -> None:
    """The three files of a recording; `.csv.xz` as suffix compresses them."""
    folder.mkdir(parents=True, exist_ok=True)
    tracks = pd.concat([_rows(int(id), mover) for mover in movers], ignore_index=True)
    meta = pd.DataFrame(
        {
            "recordingId": int(id),
            "trackId": [mover.track for mover in movers],
            "initialFrame": [mover.first_frame for mover in movers],
            "finalFrame": [mover.first_frame + len(mover.centre) - 1 for mover in movers],
            "numFrames": [len(mover.centre) for mover in movers],
            "width": [mover.width for mover in movers],
            "length": [mover.length for mover in movers],
            "class": [mover.road_user for mover in movers],
        }
    )
    frames = int(tracks["frame"].max()) + 1
    recording = {
        **{"recordingId": int(id), "locationId": location, "frameRate": FRAME_RATE, "speedLimit": 13.88},
        **{"weekday": "tuesday", "startTime": 9, "duration": seconds or frames / FRAME_RATE, "numTracks": len(movers)},
        **{"numVehicles": len(movers), "numVRUs": 0, "latLocation": 50.78, "lonLocation": 6.07},
        **{"xUtmOrigin": 293487.1224, "yUtmOrigin": 5629711.58163, "orthoPxToMeter": 0.0081},
    }
    tables = {"tracks": tracks, "tracksMeta": meta, "recordingMeta": pd.DataFrame([recording])}
    for kind, table in tables.items():
        table.to_csv(folder / f"{id}_{kind}{suffix}", index=False)


def small_recordings(folder: Path, map: str) -> None:
    """Three recordings on a map that ships, one for each split: of one vehicle, of three that meet, of one."""
    place = Intersection.load(map)
    movers = [
        on_route(place, route, track, 0.0, steady(position, speed), 13.0)
        for track, route, position, speed in MOVERS[map]
    ]
    for id, own in (("00", movers[:1]), ("01", movers), ("02", movers[:1])):
        write_recording(folder, id, own, location=place.locations[0])


def _rows(recording: int, mover: Mover) -> pd.DataFrame:
    centre = mover.centre
    velocity = np.gradient(centre, 1.0 / FRAME_RATE, axis=0)
    acceleration = np.gradient(velocity, 1.0 / FRAME_RATE, axis=0)
    count = len(centre)
    heading = np.degrees(np.arctan2(velocity[:, 1], velocity[:, 0])) % 360.0
    if mover.heading is not None:
        heading = np.full(count, np.degrees(mover.heading) % 360.0)
    zero = np.zeros(count)
    return pd.DataFrame(
        {
            "recordingId": recording,
            "trackId": mover.track,
            "frame": mover.first_frame + np.arange(count),
            "trackLifetime": np.arange(count),
            "xCenter": centre[:, 0],
            "yCenter": centre[:, 1],
            "heading": heading if mover.road_user in ("car", "truck_bus") else zero,
            "width": mover.width,
            "length": mover.length,
            "xVelocity": velocity[:, 0],
            "yVelocity": velocity[:, 1],
            "xAcceleration": acceleration[:, 0],
            "yAcceleration": acceleration[:, 1],
            **{"lonVelocity": np.hypot(*velocity.T), "latVelocity": zero},
            **{"lonAcceleration": zero, "latAcceleration": zero},
        }
    ).round(5)
