"""Tracks a metre aside and cut at both ends are on their own route or on none, never on a wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from data.formats.ind import read_recording
from data.pipeline.projection import MAX_EXCESS, RMS_EXCESS, Projection, project
from data.recording import Recording
from intersection_env.maps.intersection import Intersection
from tests.support.paths import RECORDINGS

CUTS = {
    **{(0.0, 0.0): 0.98, (0.2, 0.2): 0.9, (0.4, 0.1): 0.8, (0.1, 0.4): 0.6, (0.35, 0.35): 0.7},
    **{(0.6, 0.0): 0.3, (0.0, 0.6): 0.0},  # most are seen in a lane that routes share
}
"""What is cut at begin and end, as shares of the track, and at least how many of the tracks are on a route."""


@pytest.fixture(scope="module", params=["00", "13"])
def recording(request: pytest.FixtureRequest) -> Recording:
    return read_recording(RECORDINGS, request.param).resampled(0.2)


@pytest.fixture(scope="module")
def truth(recording: Recording, bendplatz: Intersection) -> dict[str, int]:
    """The route of each track, seen as a whole and where it was driven."""
    return {track.id: track.route for track in project(recording, bendplatz).tracks}


def displaced(recording: Recording, aside: float, front: float, back: float) -> Recording:
    """All tracks `aside` metres to their left, without these shares of their rows at begin and end."""
    kept = np.zeros(len(recording.frame), np.bool_)
    for begin, end in zip(recording.offsets[:-1], recording.offsets[1:], strict=True):
        kept[begin + int(front * (end - begin)) : end - int(back * (end - begin))] = True
    way = np.arctan2(recording.velocity[:, 1], recording.velocity[:, 0])
    heading = np.where(np.hypot(*recording.velocity.T) > 0.5, way, recording.heading)
    return replace(
        recording,
        offsets=np.concatenate([[0], np.cumsum(kept)])[recording.offsets],
        frame=recording.frame[kept],
        x=(recording.x - aside * np.sin(heading))[kept],
        y=(recording.y + aside * np.cos(heading))[kept],
        velocity=recording.velocity[kept],
        acceleration=recording.acceleration[kept],
        heading=recording.heading[kept],
    )


def wrong(projection: Projection, truth: dict[str, int], bendplatz: Intersection) -> list[str]:
    """Tracks on another route than theirs; in an exit lane, which all routes there share, each of them is right."""
    found: list[str] = []
    for track in projection.tracks:
        if track.id not in truth or track.route == truth[track.id]:
            continue
        route, own = bendplatz.routes[track.route], bendplatz.routes[truth[track.id]]
        in_exit = track.position[0] >= route.junction[1]
        if not in_exit or route.id.partition("-")[2] != own.id.partition("-")[2]:
            found.append(f"{track.id}: {route.id}, not {own.id}")
    return found


@pytest.mark.parametrize("aside", [-1.0, 1.0])
@pytest.mark.parametrize(("cut", "least"), CUTS.items())
def test_no_displaced_track_is_on_a_wrong_route(
    recording: Recording,
    truth: dict[str, int],
    bendplatz: Intersection,
    aside: float,
    cut: tuple[float, float],
    least: float,
) -> None:
    projection = project(displaced(recording, aside, *cut), bendplatz)
    assert not wrong(projection, truth, bendplatz)
    assert len(projection.tracks) > least * len(truth)


def test_tolerances_are_those_at_which_it_holds() -> None:
    assert RMS_EXCESS <= 2.0
    assert MAX_EXCESS <= 3.0
