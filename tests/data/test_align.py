"""Lanes that were drawn beside the traffic are moved to where the cars drive."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.align.__main__ import main
from data.align.align import align, compiled
from data.align.drives import Drive, find_drives
from data.align.shift import LaneShift, following, lane_shifts, shifted
from data.align.source_file import write_source
from data.formats.ind import read_recording
from data.recording import Recording
from intersection_env.maps.curve import along
from intersection_env.maps.intersection import MAPS, Intersection
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import Lane
from tests.support.recordings import Floats, Mover, on_route, steady, write_recording

TRUE = MAPS / "t_junction.json"
LOCATION = 902
CARS = 6  # on each route
ROUTES = ("W-E", "W-S", "E-W", "E-S", "S-W")


def shift(lane: str, begin: float, end: float) -> LaneShift:
    station = along(MapSource.read(TRUE).lanes[lane].points)[[0, -1]]
    return LaneShift(0, station, np.array([begin, end]))


def traffic(
    folder: Path, intersection: Intersection, cars: int = CARS, aside: float = 0.0, routes: Sequence[str] = ROUTES
) -> None:
    """Cars on these routes, from 30 m behind the begin of the map to 30 m before its end, spread by half a metre."""
    movers: list[Mover] = []
    for number, route in enumerate(one for one in intersection.routes if one.id in routes):
        seconds = (route.length - 60.0) / 10.0
        for car in range(cars):
            place = aside + 0.1 * (car - 0.5 * (cars - 1))
            movers.append(
                on_route(
                    intersection, route.id, len(movers), 6.0 * car + number, steady(30.0, 10.0), seconds, aside=place
                )
            )
    write_recording(folder, "07", movers, location=LOCATION)


def aside(drives: list[Drive], route: int) -> float:
    return float(np.median(np.abs(np.concatenate([drive.left for drive in drives if drive.route == route]))))


@pytest.fixture(scope="module")
def true_map() -> Intersection:
    return Intersection.load("t_junction")


@pytest.fixture(scope="module")
def recording(true_map: Intersection, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("recordings")
    traffic(folder, true_map)
    return read_recording(folder, "07")


def test_displaced_lanes_find_back_to_the_cars(recording: Recording, true_map: Intersection) -> None:
    wrong = {
        "W_in": shift("W_in", -1.0, -1.0),
        "E_in": shift("E_in", -0.8, -0.8),
        "E_out": shift("E_out", -0.4, -1.4),
        "W_out": shift("W_out", 1.2, 0.2),
    }
    true = MapSource.read(TRUE)
    source = shifted(true, wrong)
    alignment = align(source, compiled(source), [recording])
    assert not alignment.limited
    for name in ("W-E", "E-W"):
        route = true_map.route_index(name)
        assert aside(alignment.drives[0], route) > 0.6
        assert aside(alignment.drives[1], route) < 0.2
    for name in wrong:
        way = along(true.lanes[name].points)[-1] * np.linspace(0.3, 0.9, 7)
        if name in ("W_out", "E_out"):
            way = way[::-1] - 0.2 * way[-1]  # the tracks begin and end 30 m from the edge
        points = alignment.source.lanes[name].points
        order = np.argsort(points[:, 0])
        north = np.interp(_east(true, name, way), *points[order].T)
        assert np.abs(north - true.lanes[name].points[0, 1]).max() < 0.3, name


def _east(source: MapSource, lane: str, way: Floats) -> Floats:
    points = source.lanes[lane].points
    return np.asarray(np.interp(way, along(points), points[:, 0]))


def test_lanes_with_few_cars_and_all_else_stay(tmp_path: Path, true_map: Intersection) -> None:
    traffic(tmp_path, true_map, cars=2, aside=0.3)
    drives = find_drives([read_recording(tmp_path, "07")], true_map)
    source = MapSource.read(TRUE)
    # 2 cars on each of the routes there: S_in by S-W alone, W_in by W-E and W-S.
    assert set(lane_shifts(source, true_map, drives, 3)) == {"W_in", "E_in", "W_out", "S_out", "S_out_outer"}
    alignment = align(source, true_map, [read_recording(tmp_path, "07")], least_cars=3)
    for name in ("S_in", "S_in_outer", "E_out"):
        assert np.array_equal(alignment.source.lanes[name].points, source.lanes[name].points)
    assert alignment.source.stop_lines is source.stop_lines
    assert alignment.source.routes is source.routes


def test_shift_is_constant_beyond_the_tracks_and_smooth_between() -> None:
    source = MapSource.read(TRUE)
    intersection = Intersection.load("t_junction")
    seen = np.arange(60.0, 140.0)
    left = np.where(seen < 100.0, 0.5, 1.5)
    drives = [Drive(intersection.route_index("W-E"), seen, left, np.zeros((len(seen), 2)))] * 5
    found = lane_shifts(source, intersection, drives, 5)["W_in"]
    assert found.cars == 5
    assert found.left[found.station < 60.0] == pytest.approx(found.left[0], abs=0.02)
    assert found.left[0] == pytest.approx(0.5, abs=0.1)
    assert found.left[-1] == pytest.approx(1.5, abs=0.1)
    assert (np.diff(found.left) > -1e-6).all()
    assert np.diff(found.left).max() < 0.4


def halved(source: MapSource) -> MapSource:
    """The source with W_in as two lanes, "W_far" and "W_in", that touch."""
    lane = source.lanes["W_in"]
    middle, width = lane.points.mean(axis=0, keepdims=True), lane.width[:1]
    halves = {
        "W_far": Lane(np.concatenate([lane.points[:1], middle]), np.repeat(width, 2)),
        "W_in": Lane(np.concatenate([middle, lane.points[-1:]]), np.repeat(width, 2)),
    }
    routes = [
        replace(route, approach=("W_far", *route.approach)) if route.approach == ("W_in",) else route
        for route in source.routes
    ]
    return replace(source, lanes=source.lanes | halves, routes=tuple(routes))


def test_lanes_that_follow_each_other_stay_joined() -> None:
    """A jump between them would be a kink, before which every driver model brakes."""
    source = halved(MapSource.read(TRUE))
    intersection = compiled(source)
    assert following(source) == [("W_far", "W_in")]
    far = along(source.lanes["W_far"].points)[-1]
    seen = np.arange(2.0, far + 60.0)
    left = np.where(seen < far, 1.0, 0.0)
    drives = [Drive(intersection.route_index("W-E"), seen, left, np.zeros((len(seen), 2)))] * 5
    shifts = lane_shifts(source, intersection, drives, 5)
    assert shifts["W_far"].left[0] == pytest.approx(1.0, abs=0.1)
    assert shifts["W_in"].left[-1] == pytest.approx(0.0, abs=0.1)
    lanes = shifted(source, shifts).lanes
    assert lanes["W_far"].points[-1] == pytest.approx(lanes["W_in"].points[0], abs=0.02)


def test_they_move_equally_far_where_the_map_allows_no_more(tmp_path: Path) -> None:
    """Cars on W_far alone drive so far left that it would lie on W_out: both halves move by the same part."""
    source = halved(MapSource.read(TRUE))
    intersection = compiled(source)
    traffic(tmp_path, intersection, aside=1.9, routes=["W-E"])
    alignment = align(source, intersection, [read_recording(tmp_path, "07")])
    assert any('lanes "W_far, W_in" move' in word or 'lanes "W_in, W_far" move' in word for word in alignment.limited)
    lanes = alignment.source.lanes
    assert lanes["W_far"].points[-1] == pytest.approx(lanes["W_in"].points[0], abs=0.03)


def test_ways_inside_are_moved_to_the_centimetre_too() -> None:
    """As the file will hold them: what is tried must be what is written."""
    source = MapSource.read(TRUE)
    angle = np.linspace(0.0, 0.5 * np.pi, 30)
    bend = np.stack([-11.0 + 9.4 * np.sin(angle), -1.65 - 9.4 * (1.0 - np.cos(angle))], axis=1)
    routes = tuple(replace(one, inside=bend) if one.id == "W-S" else one for one in source.routes)
    aside = LaneShift(5, along(bend)[[0, -1]], np.array([0.3, 0.4]))
    moved = shifted(replace(source, routes=routes), {"inside W-S": aside}).routes
    (inside,) = (one.inside for one in moved if one.id == "W-S")
    assert inside is not None
    assert np.array_equal(inside, np.round(inside, 2))


def test_one_car_off_the_way_does_not_move_a_lane() -> None:
    source = MapSource.read(TRUE)
    intersection = Intersection.load("t_junction")
    seen = np.arange(20.0, 140.0)
    route = intersection.route_index("W-E")
    drives = [Drive(route, seen, np.full(len(seen), left), np.zeros((len(seen), 2))) for left in (0, 0, 0.1, 0.1, 2.9)]
    found = lane_shifts(source, intersection, drives, 5)["W_in"]
    assert found.left == pytest.approx(0.1, abs=1e-6)


def test_constant_shift_adds_no_points_and_a_bend_keeps_its_shape() -> None:
    lane = Lane(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), np.array([3.0, 3.5, 3.0]))
    source = replace(MapSource.read(TRUE), lanes={"bent": lane})
    by_one = LaneShift(5, np.array([0.0, 20.0]), np.array([1.0, 1.0]))
    moved = shifted(source, {"bent": by_one}).lanes["bent"]
    assert moved.points == pytest.approx(np.array([[0.0, 1.0], [9.0, 1.0], [9.0, 10.0]]))
    assert moved.width.tolist() == [3.0, 3.5, 3.0]


def test_shift_that_does_not_compile_is_limited_and_said(tmp_path: Path, true_map: Intersection) -> None:
    """Cars drive so far left that E_in would come to lie on W_out, whose routes would conflict before their lines."""
    traffic(tmp_path, true_map, aside=1.6, routes=["E-W"])
    alignment = align(MapSource.read(TRUE), true_map, [read_recording(tmp_path, "07")])
    assert alignment.limited
    assert all("of the shift only, else" in word for word in alignment.limited)
    assert compiled(alignment.source).checksum == alignment.after.checksum


def test_command_writes_map_picture_and_table(
    tmp_path: Path, true_map: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    traffic(tmp_path / "in", true_map)
    moved = shifted(MapSource.read(TRUE), {"W_in": shift("W_in", -1.0, -1.0)})
    write_source(TRUE, moved, tmp_path / "wrong.json", "wrong", "Moved.")
    out = tmp_path / "deep" / "right.json"
    assert main([str(tmp_path / "wrong.json"), str(tmp_path / "in"), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "S_in_outer" in printed
    row = next(line for line in printed.splitlines() if line.startswith("W-E")).split()
    assert row[1] == row[5] == str(CARS)
    assert float(row[3]) > 0.4
    assert float(row[7]) < 0.25
    assert {path.name for path in out.parent.iterdir()} == {"right.json", "right.png"}
    before, after = (json.loads(path.read_text()) for path in (TRUE, out))
    kept = ("format", "version", "locations", "arms", "stop_lines", "routes", "yields")
    assert {key: after[key] for key in kept} == {key: before[key] for key in kept}
    assert after["name"] == "wrong_aligned"
    assert "Moved. Lanes moved to where recorded cars drive" in after["about"]
    assert compiled(MapSource.read(out)).locations == (LOCATION,)


def test_the_file_written_is_the_map_that_was_found_to_compile(tmp_path: Path, true_map: Intersection) -> None:
    """To the last digit: rounded afterwards, a map that just compiles may not."""
    traffic(tmp_path / "in", true_map, aside=0.3)
    content = json.loads(TRUE.read_text())
    content["lanes"]["S_in"]["points"][0][0] += 0.00123  # of a lane that stays, finer than what is written of others
    fine = tmp_path / "fine.json"
    fine.write_text(json.dumps(content))
    source = MapSource.read(fine)
    alignment = align(source, compiled(source), [read_recording(tmp_path / "in", "07")], least_cars=CARS + 1)
    assert "S_in" not in alignment.shifts[0]
    write_source(fine, alignment.source, tmp_path / "out.json", source.name, "")
    assert Intersection.load(tmp_path / "out.json").checksum == alignment.after.checksum


@pytest.mark.parametrize(
    ("map", "out", "words"),
    [
        ("t_junction", "out.map", "--out must end in .json"),
        ("nowhere", "out.json", 'no map "nowhere" ships'),
        ("bendplatz", "out.json", "location 902"),
    ],
)
def test_bad_arguments_are_named(
    tmp_path: Path, true_map: Intersection, capsys: pytest.CaptureFixture[str], map: str, out: str, words: str
) -> None:
    traffic(tmp_path / "in", true_map, cars=1)
    assert main([map, str(tmp_path / "in"), "--out", str(tmp_path / out)]) == 1
    assert words in capsys.readouterr().err
    assert not (tmp_path / out).exists()


def test_a_name_that_cannot_name_a_file_is_refused_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.json"
    assert main(["t_junction", str(tmp_path / "nowhere"), "--out", str(out), "--name", "a/b"]) == 1
    assert "as it names files, not 'a/b'" in capsys.readouterr().err
    assert not out.exists()


def test_recordings_without_a_car_on_the_map_are_refused(tmp_path: Path, true_map: Intersection) -> None:
    bicycle = on_route(true_map, "W-E", 1, 0.0, steady(50.0, 5.0), 10.0, "bicycle")
    write_recording(tmp_path, "07", [bicycle], location=LOCATION)
    with pytest.raises(ValueError, match='no car of the recordings drives on a route of map "t_junction"'):
        align(MapSource.read(TRUE), true_map, [read_recording(tmp_path, "07")])
