"""One recording to scenes: its longest stretches without crossing pedestrians or overtaking."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from data.pipeline.extrapolation import extrapolate
from data.pipeline.filters import Interval, crossings, overtakings, touchings
from data.pipeline.joining import join_standing
from data.pipeline.projection import project
from data.recording import Recording
from intersection_env.constants import DT
from intersection_env.maps.intersection import XY, Intersection
from intersection_env.scenes.scene import Scene, Track

FAR = 30.0  # [m], ours: road users of the map's place are nearer to its routes; pavements and yards included
MOST_LOOKED_AT = 1000  # ours: rows of a recording, evenly chosen, show where it lies
LEAST_DURATION = 12.0  # [s], ours: a prediction of 10 s from more than one moment


def build_scenes(recording: Recording, split: str, intersection: Intersection) -> tuple[list[Scene], dict[str, float]]:
    """The scenes of a recording, and what was dropped, as "tracks: parked" or "seconds: overtaking".

    A track that spans two scenes appears in both, under one id.

    Raises:
        ValueError: the recording is of a location that the map is not made for, or far from it, or its frame
            rate has no whole number of frames in 0.2 s.
    """
    check_location(recording.id, recording.location, intersection)
    recording, joints = join_standing(recording.resampled(DT))
    check_distance(recording, intersection)
    projection = project(recording, intersection)
    reasons: defaultdict[str, float] = defaultdict(float)
    reasons.update({f"not read: {what}": count for what, count in recording.left_out.items()})
    reasons.update({f"tracks: {reason}": count for reason, count in projection.dropped.items()})
    if joints:
        reasons["tracks: joined where they stood"] = joints
    steps = int(recording.frame.max(initial=-1)) + 1
    extrapolation: Counter[str] = Counter()
    tracks = extrapolate(projection.tracks, intersection, extrapolation)
    reasons.update({f"extrapolation: {reason}": count for reason, count in extrapolation.items()})
    cuts = [*crossings(recording, projection, intersection), *overtakings(tracks, intersection)]
    cut = _cut_out([*cuts, *touchings(tracks, intersection)], steps, reasons)
    scenes: list[Scene] = []
    for begin, end in _free_stretches(cut):
        inside = _sliced(tracks, begin, end)
        too_short = (end - begin - 1) * DT < LEAST_DURATION - 1e-6
        if too_short or not inside:
            reason = "shorter than 12 s" if too_short else "no vehicle"
            reasons[f"stretches: {reason}"] += 1
            reasons[f"seconds: {reason}"] += (end - begin) * DT
            continue
        start = begin * DT
        id = f"{recording.id}/{len(scenes)}"
        scenes.append(Scene(id, recording.id, split, start, end - begin, tuple(inside)))
    seen = {track.id for scene in scenes for track in scene.tracks}
    reasons["tracks: in no scene"] += sum(track.id not in seen for track in tracks)
    return scenes, reasons


def check_location(recording: str, location: int | None, intersection: Intersection) -> None:
    """Refuses a recording of another place than the map's; one that names no place is taken.

    Raises:
        ValueError: the location is not one of the map's.
    """
    if location is not None and location not in intersection.locations:
        known = ", ".join(map(str, intersection.locations)) or "none"
        raise ValueError(
            f'recording {recording} is of location {location}, but map "{intersection.name}" is made for location'
            f" {known}; {give_map_of(str(location))}"
        )


def check_distance(recording: Recording, intersection: Intersection) -> None:
    """Refuses a recording that lies beside the map: in other coordinates, or at another place.

    Raises:
        ValueError: half of its road users are further from every route; the message says how far.
    """
    rows = np.arange(0, len(recording.x), max(1, len(recording.x) // MOST_LOOKED_AT))
    if not len(rows):
        return
    points = shapely.points(recording.x[rows], recording.y[rows])
    routes = [shapely.LineString(route.samples[:, XY].astype(np.float64)) for route in intersection.routes]
    far = np.min([shapely.distance(points, route) for route in routes], axis=0)
    if np.median(far) > FAR:
        middle = f"{np.median(recording.x):.0f}, {np.median(recording.y):.0f}"
        place = ", ".join(f"{one:.0f}" for one in np.median([route.centroid.coords[0] for route in routes], axis=0))
        raise ValueError(
            f"recording {recording.id} lies {np.median(far):.0f} m (median) from the routes of map"
            f' "{intersection.name}": around [{middle}], and the map around [{place}]; wanted both in the same metres'
            " (python -m data.maps FILE --recordings FOLDER moves a map to where they drive; else --shift, --origin)"
        )


def give_map_of(location: str) -> str:
    """What helps against recordings of a location, or of several ("1, 4"), for which a map is not made."""
    return f'give a map of that place (--map PATH, a source .json or compiled .map whose "locations" lists {location})'


def _cut_out(cuts: Iterable[Interval], steps: int, reasons: defaultdict[str, float]) -> NDArray[np.bool_]:
    """Which steps are cut out; counts, for each reason, its stretches and their seconds.

    A step that several reasons cut out counts under the first of them.
    """
    cut = np.zeros(steps, dtype=np.bool_)
    by_reason: dict[str, NDArray[np.bool_]] = {}
    for reason, begin, end in cuts:
        by_reason.setdefault(reason, np.zeros(steps, dtype=np.bool_))[max(begin, 0) : end] = True
    for reason, own in by_reason.items():
        stretches = np.split(own & ~cut, np.flatnonzero(np.diff(own.astype(np.int8)) == 1) + 1)
        reasons[f"stretches: {reason}"] += sum(bool(stretch.any()) for stretch in stretches)
        reasons[f"seconds: {reason}"] += float((own & ~cut).sum() * DT)
        cut |= own
    return cut


def _free_stretches(cut: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[True], cut, [True]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _sliced(tracks: Iterable[Track], begin: int, end: int) -> list[Track]:
    """The tracks between two steps of the recording, their starts counted from the first."""
    inside: list[Track] = []
    for track in tracks:
        if track.start < end and track.stop > begin:
            part = slice(max(begin - track.start, 0), end - track.start)
            inside.append(
                replace(
                    track,
                    start=max(track.start - begin, 0),
                    position=track.position[part],
                    speed=track.speed[part],
                    acceleration=track.acceleration[part],
                    observed=track.observed[part],
                )
            )
    return inside
