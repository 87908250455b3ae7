"""A car that changes lanes is followed where both lanes lead to the same place, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.align.align import align
from data.formats.ind import read_recording
from data.maps.__main__ import main
from data.pipeline.projection import CHANGES, Projection, project
from intersection_env.maps.intersection import XY, Intersection
from intersection_env.maps.source import MapSource
from tests.support.lane_maps import junction, write_commonroad_map
from tests.support.recordings import Mover, write_recording


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("map")
    write_commonroad_map(folder / "map.xml", junction(main_lanes=2))
    assert main([str(folder / "map.xml"), "--out", str(folder / "two_lanes.json"), "--locations", "1"]) == 0
    return folder / "two_lanes.json"


@pytest.fixture(scope="module")
def two_lanes(path: Path) -> Intersection:
    return Intersection.load(path)


def along(intersection: Intersection, routes: tuple[str, str], aside: float = 0.0, track: int = 1) -> Mover:
    """A car from one route to another, between 30 and 45 m, at 10 m/s."""
    s = np.arange(10.0, 130.0, 10.0 / 25.0)
    lines = [intersection.sample(intersection.route_index(id), s.astype(np.float32)) for id in routes]
    share = np.clip((s - 30.0) / 15.0, 0.0, 1.0)[:, None]
    points = (1.0 - share) * lines[0][:, XY] + share * lines[1][:, XY]
    return Mover(track, "car", 0, points + np.array([0.0, aside]))


def projected(folder: Path, intersection: Intersection, mover: Mover) -> Projection:
    write_recording(folder, "07", [mover])
    return project(read_recording(folder, "07").resampled(0.2), intersection)


@pytest.mark.parametrize("routes", [("W-E", "W-E.2"), ("W-E.2", "W-E"), ("E-W", "E-W.2")])
def test_a_change_of_lanes_is_followed_onto_the_last_one(
    tmp_path: Path, two_lanes: Intersection, routes: tuple[str, str]
) -> None:
    found = projected(tmp_path, two_lanes, along(two_lanes, routes))
    assert [two_lanes.routes[track.route].id for track in found.tracks] == [routes[1]]
    assert found.dropped[CHANGES] == 1
    assert np.diff(found.tracks[0].position).max() == pytest.approx(2.0, abs=0.3)


def test_who_keeps_to_a_lane_changes_none(tmp_path: Path, two_lanes: Intersection) -> None:
    found = projected(tmp_path, two_lanes, along(two_lanes, ("W-E", "W-E")))
    assert [two_lanes.routes[track.route].id for track in found.tracks] == ["W-E"]
    assert found.dropped[CHANGES] == 0


def test_who_leaves_the_lanes_is_on_no_route(tmp_path: Path, two_lanes: Intersection) -> None:
    found = projected(tmp_path, two_lanes, along(two_lanes, ("W-E", "W-E.2"), aside=-6.0))
    assert not found.tracks


def test_a_way_drawn_inside_is_moved_to_where_cars_drive(tmp_path: Path, path: Path, two_lanes: Intersection) -> None:
    def turning(track: int) -> Mover:
        index = two_lanes.route_index("S-W")
        s = np.arange(10.0, 150.0, 0.3)
        line = two_lanes.sample(index, s.astype(np.float32))
        begin, end = two_lanes.routes[index].junction
        inside = np.clip((s - begin) * (end - s) / (0.5 * (end - begin)) ** 2, 0.0, 1.0)
        left = np.stack([-np.sin(line[:, 2]), np.cos(line[:, 2])], axis=1)
        return Mover(track, "car", 400 * track, line[:, XY] + 1.2 * inside[:, None] * left)

    write_recording(tmp_path, "07", [turning(track) for track in range(5)])
    source = MapSource.read(path)
    moved = align(source, two_lanes, [read_recording(tmp_path, "07")])
    before, after = (next(route for route in one.routes if route.id == "S-W").inside for one in (source, moved.source))
    assert before is not None
    assert after is not None
    middle = [one[len(one) // 2] for one in (before, after)]
    assert 0.5 < float(np.linalg.norm(middle[1] - middle[0])) < 2.0
    aside = [float(np.quantile(np.abs(np.concatenate([one.left for one in drives])), 0.95)) for drives in moved.drives]
    assert aside[1] < 0.6 * aside[0]
