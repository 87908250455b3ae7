"""An id that changes while its vehicle stands is one track again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.formats.ind import read_recording
from data.pipeline.joining import join_standing
from data.recording import Recording
from intersection_env.maps.intersection import Intersection
from tests.support.built_scenes import scenes_of
from tests.support.recordings import Floats, Mover, on_route, standing, write_recording

PLACE = 70.0  # [m] along SW-NE, before its stop line


def arriving(speed: float = 6.0, deceleration: float = 2.0) -> Callable[[Floats], Floats]:
    """Comes to rest at PLACE after speed / deceleration."""
    return lambda time: PLACE - 0.5 * deceleration * np.maximum(speed / deceleration - time, 0.0) ** 2


def leaving(begin: float, acceleration: float = 1.5) -> Callable[[Floats], Floats]:
    """Stands at PLACE, and drives off after `begin` seconds."""
    return lambda time: PLACE + 0.5 * acceleration * np.maximum(time - begin, 0.0) ** 2


def two_parts(bendplatz: Intersection, begin: float) -> list[Mover]:
    """A car that stands from 3 s on and whose first track ends at 10 s; the second begins at `begin`."""
    first = on_route(bendplatz, "SW-NE", 1, 0.0, arriving(), 10.0)
    second = on_route(bendplatz, "SW-NE", 2, begin, leaving(16.0 - begin), 24.0 - begin, aside=0.3)
    return [first, second]


def recorded(folder: Path, movers: list[Mover]) -> Recording:
    write_recording(folder, "07", movers)
    return read_recording(folder, "07").resampled(0.2)


@pytest.mark.parametrize("begin", [9.0, 10.0, 10.2, 13.0])
def test_track_goes_on_under_its_first_id(tmp_path: Path, bendplatz: Intersection, begin: float) -> None:
    recording = recorded(tmp_path, two_parts(bendplatz, begin))
    joined, joints = join_standing(recording)
    assert joints == 1
    assert joined.track_id.tolist() == [1]
    assert joined.frame.tolist() == list(range(121))
    assert joined.offsets.tolist() == [0, 121]
    at = recording.offsets[1]
    for name in ("x", "y", "velocity", "acceleration", "heading"):
        own, before = getattr(joined, name), getattr(recording, name)
        assert np.array_equal(own[: at - 1], before[: at - 1])
        assert np.array_equal(own[70:], before[at:][-51:])
    stood = slice(20, 70)
    assert np.hypot(np.diff(joined.x[stood]), np.diff(joined.y[stood])).max() < 0.35
    assert np.abs(joined.velocity[55:64]).max() == 0.0


@pytest.mark.parametrize(
    "change",
    [
        lambda two: [two[0], replace(two[1], first_frame=two[1].first_frame + 25 * 6)],  # too late
        lambda two: [two[0], replace(two[1], length=7.0)],
        lambda two: [two[0], replace(two[1], centre=two[1].centre + 1.5)],
        lambda two: [two[0], replace(two[1], road_user="truck_bus")],
        lambda two: [two[0], replace(two[1], centre=two[1].centre[25 * 8 :])],  # it drives when first seen
        lambda two: [replace(one, road_user="bicycle", length=0.0, width=0.0) for one in two],
    ],
)
def test_two_vehicles_stay_two(
    tmp_path: Path, bendplatz: Intersection, change: Callable[[list[Mover]], list[Mover]]
) -> None:
    recording = recorded(tmp_path, change(two_parts(bendplatz, 10.2)))
    joined, joints = join_standing(recording)
    assert joints == 0
    assert joined is recording


def test_id_may_change_more_than_once(tmp_path: Path, bendplatz: Intersection) -> None:
    first, last = two_parts(bendplatz, 14.0)
    between = standing(bendplatz, "SW-NE", 3, PLACE, 11.0, 2.0)
    other = on_route(bendplatz, "NW-SE", 4, 5.0, leaving(0.0), 9.0)
    recording = recorded(tmp_path, [first, last, between, other])
    joined, joints = join_standing(recording)
    assert joints == 2
    assert joined.track_id.tolist() == [1, 4]
    assert np.diff(joined.offsets).tolist() == [121, 46]
    assert np.array_equal(joined.x[joined.offsets[1] :], recording.x[recording.offsets[3] :])


def test_joints_are_counted_and_the_vehicle_takes_part(tmp_path: Path, bendplatz: Intersection) -> None:
    (scene,), dropped = scenes_of(tmp_path, bendplatz, two_parts(bendplatz, 10.4))
    assert dropped["tracks: joined where they stood"] == 1
    track = scene.track("07/1")
    assert bendplatz.routes[track.route].id == "SW-NE"
    assert len(track.position) == 121
    assert (np.diff(track.position) >= 0.0).all()
