"""Joins what one vehicle left when its id changed while it stood."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data.recording import VEHICLES, Recording
from intersection_env.constants import DT

STANDING = 0.5  # [m/s], ours: slower is the jitter of a vehicle that stands
SAME_PLACE = 1.0  # [m], ours: a standing vehicle's position jitters by less, and no two vehicles stand so close
SAME_SIZE = 1.0  # [m], ours: a body's length and width are measured anew under the new id
LONGEST_GAP = 5.0  # [s], ours: nobody drives off and is replaced at the same place within it
LONGEST_OVERLAP = 2.0  # [s], ours: for so long the old id lives on beside the new one
ROWS = ("frame", "x", "y", "velocity", "acceleration", "heading")


def join_standing(recording: Recording) -> tuple[Recording, int]:
    """The recording with such tracks as one, under the first id, and how many joints there were.

    recording: resampled to 0.2 s. One vehicle is a track that ends standing and one of its kind and size that
    begins standing at the same place, up to 5 s after that end or 2 s before it. In a gap it stands: positions run
    evenly from the last to the next, speeds are 0. Where both are there, the first track's rows are kept.
    Bicycles and pedestrians have no size to know them by, and are not joined.
    """
    follower = _followers(recording)
    if not follower:
        return recording, 0
    chains: list[list[int]] = []
    for index in range(len(recording.road_user)):
        if index not in follower.values():
            chain = [index]
            while chain[-1] in follower:
                chain.append(follower[chain[-1]])
            chains.append(chain)
    parts = [_chained(recording, chain) for chain in chains]
    first = [chain[0] for chain in chains]
    rows: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in ROWS}
    joined = replace(
        recording,
        track_id=recording.track_id[first],
        road_user=tuple(recording.road_user[index] for index in first),
        length=recording.length[first],
        width=recording.width[first],
        offsets=np.cumsum([0, *(len(part["frame"]) for part in parts)]),
        **rows,
    )
    return joined, len(follower)


def _followers(recording: Recording) -> dict[int, int]:
    """Which track goes on where one ends; each is the follower of one at most."""
    begin, end = recording.offsets[:-1], recording.offsets[1:] - 1
    sized = [
        user in VEHICLES and length > 0.0 for user, length in zip(recording.road_user, recording.length, strict=True)
    ]
    there = np.array(sized, dtype=np.bool_) & (begin <= end)
    speed = np.hypot(*recording.velocity.T)
    ends = [int(one) for one in np.flatnonzero(there) if speed[end[one]] < STANDING]
    starts = [int(one) for one in np.flatnonzero(there) if speed[begin[one]] < STANDING]
    found: list[tuple[float, int, int]] = []
    for one in ends:
        for other in starts:
            gap = recording.frame[begin[other]] - recording.frame[end[one]]
            later = recording.frame[begin[other]] > recording.frame[begin[one]]
            later &= recording.frame[end[other]] > recording.frame[end[one]]
            if one == other or not later or not -LONGEST_OVERLAP <= gap * DT <= LONGEST_GAP:
                continue
            size = max(abs(column[other] - column[one]) for column in (recording.length, recording.width))
            if size > SAME_SIZE or recording.road_user[one] != recording.road_user[other]:
                continue
            row = begin[other] + max(0, -int(gap))
            away = np.hypot(recording.x[row] - recording.x[end[one]], recording.y[row] - recording.y[end[one]])
            if away <= SAME_PLACE:
                found.append((float(away), one, other))
    followers: dict[int, int] = {}
    for _, one, other in sorted(found):
        if one not in followers and other not in followers.values():
            followers[one] = other
    return followers


def _chained(recording: Recording, chain: list[int]) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
    """The rows of a chain of tracks, each frame once and none left out."""
    parts = []
    last = -1
    for index in chain:
        rows = np.arange(recording.offsets[index], recording.offsets[index + 1])
        rows = rows[recording.frame[rows] > last]
        parts.append({name: getattr(recording, name)[rows] for name in ROWS})
        last = int(recording.frame[rows[-1]])
    rows_of = {name: np.concatenate([part[name] for part in parts]) for name in ROWS}
    frame = np.arange(rows_of["frame"][0], rows_of["frame"][-1] + 1)
    source = np.searchsorted(rows_of["frame"], frame, side="right") - 1
    gap = rows_of["frame"][source] != frame
    whole = {name: rows_of[name][source] for name in ROWS}
    for name in ("x", "y"):
        whole[name] = np.interp(frame, rows_of["frame"], rows_of[name])
    for name in ("velocity", "acceleration"):
        whole[name][gap] = 0.0
    return {**whole, "frame": frame}
