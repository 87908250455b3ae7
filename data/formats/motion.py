"""Accelerations where a format gives none."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from data.recording import Floats, Integers


def accelerations(velocity: Floats, offsets: Integers, frame_rate: float) -> Floats:
    """(row, 2): how velocities change along each track [m/s²]; 0 for a track of one row.

    velocity: (row, 2) [m/s]; the rows of track k are offsets[k] to offsets[k + 1]; frame_rate: [1/s].
    """
    found = np.zeros_like(velocity)
    for begin, end in pairwise(offsets):
        if end - begin > 1:
            found[begin:end] = np.gradient(velocity[begin:end], 1.0 / frame_rate, axis=0)
    return found
