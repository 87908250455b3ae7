"""Whether a recording's time step is one at which its road users cover the way that their speeds say."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from data.recording import Recording

SPEED_TOLERANCE = 0.1  # ours: share by which the way covered may differ from the velocities, summed over a recording
MOVING = 1.0  # [m/s], ours: slower rows are noise when ways and velocities are compared


def check_time_step(path: Path, stated: str, recording: Recording) -> None:
    """Refuses a time step at which the way covered is not what the velocities say.

    path: the file that states the time step; stated: what it says, as "frameRate 25".

    Raises:
        ValueError: they contradict each other; the message says both.
    """
    same = np.ones(len(recording.frame), dtype=bool)
    same[recording.offsets[1:] - 1] = False
    speed = np.hypot(*recording.velocity.T)
    moving = np.flatnonzero(same[:-1] & (speed[:-1] > MOVING))
    if len(moving) == 0:
        return
    way = np.hypot(recording.x[moving + 1] - recording.x[moving], recording.y[moving + 1] - recording.y[moving])
    ratio = float(way.sum() * recording.frame_rate / speed[moving].sum())
    if abs(ratio - 1.0) > SPEED_TOLERANCE:
        raise ValueError(
            f"{path}: at {stated} the tracks cover {ratio:.2f} times the way that their velocities say, which are"
            f" those of a time step of {ratio / recording.frame_rate:.4g} s, not {1.0 / recording.frame_rate:.4g} s;"
            " wanted the rate at which they were recorded, and velocities in m/s"
        )
