"""Tells a vehicle that is parked from one that stands in traffic, where it never moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from data.pipeline.route_line import RouteLine
from data.recording import Recording

STANDING_WAY = 2.0  # [m], ours: a vehicle that never gets further than this from where it was first seen stands
PASSING_ROOM = 2.5  # [m], ours: what a car of 1.8 m needs of a lane to drive past one that stands
AT_ENDS = 1  # ours: steps; who is there from this early to this late is there for all of the recording


def stands_all_along(recording: Recording, index: int) -> bool:
    """Whether the vehicle stays where it was first seen."""
    rows = slice(recording.offsets[index], recording.offsets[index + 1])
    x, y = recording.x[rows], recording.y[rows]
    return bool(np.hypot(x - x[0], y - y[0]).max() < STANDING_WAY)


def is_parked(recording: Recording, index: int, lines: Sequence[RouteLine]) -> bool:
    """Whether a vehicle that stands all along has no part in the traffic.

    It is parked where more than half of its width lies outside of every lane. At the edge of a lane so wide that
    others drive past, it is parked if it is there for all of the recording: who waits there comes or goes,
    or its id changes.
    """
    rows = slice(recording.offsets[index], recording.offsets[index + 1])
    frame = recording.frame[rows]
    lasting = frame[0] <= AT_ENDS and frame[-1] >= recording.frame.max() - AT_ENDS
    place = np.array([[np.median(recording.x[rows]), np.median(recording.y[rows])]])
    for line in lines:
        position, distance, _ = line.locate(place)
        half = 0.5 * float(line.width(position)[0])
        beyond = position[0] <= 0.0 or position[0] >= line.route.length
        if beyond or distance[0] >= half:
            continue
        room = half + float(distance[0]) - 0.5 * float(recording.width[index])
        if not lasting or room < PASSING_ROOM:
            return False
    return True
