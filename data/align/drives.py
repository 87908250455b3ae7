"""Where recorded cars drive beside the routes of a map."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data.pipeline.projection import project
from data.pipeline.route_line import RouteLine
from data.recording import Recording
from intersection_env.constants import DT
from intersection_env.maps.intersection import Intersection

RMS_EXCESS, MAX_EXCESS = 3.0, 5.0  # [m], ours: a lane that is drawn this far off still finds its cars
DRIVING = 1.0  # [m/s], ours: who stands weighs no more than who drives past
MOTOR = ("car", "truck_bus")  # bicycles ride at the edge


class Drive(NamedTuple):
    """One car on its route, while it drives.

    position: (row,) arc length on the route [m]; left: (row,) of the centreline [m]; points: (row, 2) [m].
    """

    route: int
    position: NDArray[np.float64]
    left: NDArray[np.float64]
    points: NDArray[np.float64]


def find_drives(recordings: Iterable[Recording], intersection: Intersection) -> list[Drive]:
    """The cars and trucks of recordings on the routes that they fit, with generous tolerances."""
    lines = [RouteLine(intersection, route) for route in intersection.routes]
    drives: list[Drive] = []
    for recording in (one.resampled(DT) for one in recordings):
        number = {f"{recording.id}/{id}": index for index, id in enumerate(recording.track_id)}
        for track in project(recording, intersection, RMS_EXCESS, MAX_EXCESS).tracks:
            if track.road_user not in MOTOR:
                continue
            first = recording.offsets[number[track.id]]
            first += track.start - recording.frame[first]
            rows = np.arange(first, first + len(track.position))[track.speed > DRIVING]
            position = track.position[track.speed > DRIVING].astype(np.float64)
            points = np.stack([recording.x[rows], recording.y[rows]], axis=1)
            if len(rows):
                drives.append(Drive(track.route, position, lines[track.route].left(position, points), points))
    return drives
