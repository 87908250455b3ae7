"""Maps of lanes become map sources that compile, and whatever is not read or guessed is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.maps.__main__ import main
from data.maps.bend import room_of
from data.maps.commonroad_file import read_commonroad
from data.maps.place import shift_to
from data.maps.utm import utm
from data.recording import Recording
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.source import MapSource
from tests.support.imported_maps import imported, refused
from tests.support.lane_maps import (
    Drawn,
    Junction,
    Rule,
    into,
    junction,
    out_of,
    write_commonroad_map,
    write_lanelet2_map,
)

ALL = {f"{a}-{b}" for a in "ENWS" for b in "ENWS" if a != b}
INSIDE_E_W = 1002


@pytest.mark.parametrize("suffix", [".xml", ".osm"])
def test_both_formats_give_the_same_map(tmp_path: Path, suffix: str) -> None:
    source = imported(tmp_path, junction(), suffix=suffix)
    assert {route.id for route in source.routes} == ALL
    assert set(source.lanes) == {f"{arm}_{way}" for arm in "ENWS" for way in ("in", "out")}
    assert source.lanes["W_in"].points[-1] == pytest.approx([-12.0, -1.75], abs=0.05)
    assert source.lanes["W_in"].points[0] == pytest.approx([-82.0, -1.75], abs=0.05)
    assert source.lanes["N_out"].width == pytest.approx(3.5, abs=0.02)
    assert len(Intersection.load(tmp_path / "out.json").conflicts) > 20


def test_a_way_inside_the_junction_lies_in_the_lane_that_is_drawn(tmp_path: Path) -> None:
    drawn = junction()
    straight = drawn.lanelets[INSIDE_E_W].centre
    bent = straight + np.outer(1.5 * np.sin(np.linspace(0.0, np.pi, len(straight))), [0.0, 1.0])
    imported(tmp_path, drawn.changed(INSIDE_E_W, centre=bent))
    route = Intersection.load(tmp_path / "out.json")
    samples = route.routes[route.route_index("E-W")].samples
    north = samples[np.abs(samples[:, 0]) < 3.0, 1].max()
    room = room_of(np.array([3.5]))[0]
    assert 1.75 + 1.5 - room - 0.01 < north < 1.75 + 1.5 - 0.5 * room  # in the lane, and not where it bends most


def test_parallel_lanes_are_routes_side_by_side(tmp_path: Path) -> None:
    source = imported(tmp_path, junction(main_lanes=2))
    routes = {route.id: route for route in source.routes}
    assert set(routes) == ALL | {"E-W.2", "W-E.2"}
    assert routes["W-E"].approach != routes["W-E.2"].approach
    assert routes["W-E"].leaving != routes["W-E.2"].leaving
    assert routes["W-S"].approach == routes["W-E"].approach  # from right to left: the right lane turns right
    assert routes["W-N"].approach == routes["W-E.2"].approach
    right, left = (source.lanes[routes[id].approach[-1]].points[-1][1] for id in ("W-E", "W-E.2"))
    assert right < left < 0.0


@pytest.mark.parametrize("suffix", [".xml", ".osm"])
def test_a_lane_that_turns_back_is_a_route_from_its_arm_to_itself(tmp_path: Path, suffix: str) -> None:
    drawn, id = junction(), 1999
    begin, end = drawn.lanelets[into("W")], drawn.lanelets[out_of("W")]
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)
    turn = np.array([-10.0, 0.0]) + np.stack([4.0 * np.cos(angle), 1.75 * np.sin(angle)], axis=1)
    curve = np.concatenate([begin.centre[-1:], turn, end.centre[:1]])
    drawn = drawn.changed(into("W"), successors=(*begin.successors, id))
    drawn = Junction(drawn.lanelets | {id: Drawn(id, curve, (out_of("W"),))})
    source = imported(tmp_path, drawn, suffix=suffix)
    assert {route.id for route in source.routes} == ALL | {"W-W"}
    back = next(route for route in source.routes if route.id == "W-W")
    assert (back.approach, back.leaving) == (("W_in",), ("W_out",))
    assert back.inside is not None
    assert back.inside[:, 0].max() > -7.5  # its bound on the inside is all but a point


def test_signs_say_who_yields(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawn = junction().changed(into("N"), signs=("206",)).changed(into("S"), signs=("205",))
    for arm in "EW":
        drawn = drawn.changed(into(arm), signs=("306", "274=40mph"))
    source = imported(tmp_path, drawn)
    assert {name: arm.right_of_way for name, arm in source.arms.items()} == {
        "E": "priority", "N": "stop", "W": "priority", "S": "yield",
    }  # fmt: skip
    assert source.arms["E"].speed_limit == pytest.approx(40 * 0.44704, abs=0.02)
    output = capsys.readouterr().out
    assert 'arm "N": 50 km/h, for the file says no limit' in output
    assert "right of way" not in output


def test_right_of_way_elements_say_who_yields_and_where_the_line_is(tmp_path: Path) -> None:
    prior = (into("E"), into("W"))
    rules = [Rule((into("N"),), prior), Rule((into("S"),), prior, ((0.0, -10.5), (3.5, -10.5)))]
    source = imported(tmp_path, replace(junction(), rules=rules), suffix=".osm")
    assert {name: arm.right_of_way for name, arm in source.arms.items()} == {
        "E": "priority", "N": "yield", "W": "priority", "S": "yield",
    }  # fmt: skip
    assert source.stop_lines["S_in"][:, 1] == pytest.approx(-10.5, abs=0.05)
    conflicts = Intersection.load(tmp_path / "out.json")
    ids = [route.id for route in conflicts.routes]
    yields = {(ids[one.yielder], ids[one.prioritized]) for one in conflicts.conflicts}
    assert ("S-N", "W-E") in yields
    assert ("N-E", "W-E") in yields


def test_without_signs_the_road_of_more_lanes_is_guessed_to_be_the_main_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = imported(tmp_path, junction(main_lanes=2))
    assert {name for name, arm in source.arms.items() if arm.right_of_way == "priority"} == {"E", "W"}
    assert "the main road is E and W" in capsys.readouterr().out
    imported(tmp_path, junction())
    assert "right before left" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("suffix", "kind", "counted"),
    [(".xml", "busLane", "bus lane"), (".xml", "bicycleLane", "bicycle lane"), (".osm", "bus_lane", "bus lane"),
     (".osm", "bicycle_lane", "bicycle lane"), (".osm", "walkway", "walkway")],
)  # fmt: skip
def test_lanes_without_cars_are_left_out_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, kind: str, counted: str
) -> None:
    drawn = junction(main_lanes=2)
    source = imported(tmp_path, drawn.changed(into("W", 1), kind=kind), suffix=suffix)
    assert not {"W-E.2", "W-S"} & {route.id for route in source.routes}
    lines = [line for line in capsys.readouterr().out.splitlines() if f"lanelet: {counted}" in line]
    assert len(lines) == 1
    assert lines[0].split()[-1] == "1"


def test_of_several_junctions_one_is_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = junction(), junction().moved(400.0, 30.0)
    second = {
        id + 5000: replace(drawn, id=id + 5000, successors=tuple(after + 5000 for after in drawn.successors))
        for id, drawn in other.lanelets.items()
    }
    both = Junction(one.lanelets | second)
    write_commonroad_map(tmp_path / "map.xml", both)
    message = refused(tmp_path, capsys, tmp_path / "map.xml")
    assert "2 junctions are on this map; give one by --around=x,y,radius" in message
    assert "400,30," in message
    source = imported(tmp_path, both, "--around", "400,30,20")
    assert source.lanes["W_in"].points[-1] == pytest.approx([388.0, 28.25], abs=0.05)


def test_a_joint_of_which_one_bound_is_drawn_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawn = junction()
    narrow = drawn.lanelets[out_of("W")]
    shifted = narrow.centre + np.array([0.0, 0.5])  # the right bounds touch, the left ones do not
    drawn = drawn.changed(out_of("W"), centre=shifted, width=2.5)
    drawn = drawn.changed(INSIDE_E_W, successors=())
    source = imported(tmp_path, drawn)
    assert "E-W" in {route.id for route in source.routes}
    assert (
        f"lanelet {INSIDE_E_W} leads into {out_of('W')}, though only one of their bounds does"
        in capsys.readouterr().out
    )


def test_what_the_reader_does_not_know_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_commonroad_map(tmp_path / "map.xml", junction())
    text = (tmp_path / "map.xml").read_text().replace("</commonRoad>", "<kiosk/><kiosk/></commonRoad>")
    (tmp_path / "map.xml").write_text("\ufeff" + text, encoding="utf-8")
    assert main([str(tmp_path / "map.xml"), "--out", str(tmp_path / "out.json")]) == 0
    assert any("not read: kiosk" in line and line.endswith(" 2") for line in capsys.readouterr().out.splitlines())


def turned(text: str, id: int, side: str) -> str:
    """A CommonRoad map's text with one bound of a lanelet drawn the other way round."""
    begin = text.index(f"<{side}>", text.index(f'<lanelet id="{id}">')) + len(f"<{side}>")
    end = text.index(f"</{side}>", begin)
    points = text[begin:end].split("</point>")[:-1]
    return text[:begin] + "".join(f"{one}</point>" for one in points[::-1]) + text[end:]


@pytest.mark.parametrize("sides", [("leftBound",), ("rightBound",), ("leftBound", "rightBound")])
def test_bounds_drawn_backwards_are_turned_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sides: tuple[str, ...]
) -> None:
    """The left bound is on the left of who drives there, whichever way it is drawn."""
    write_commonroad_map(tmp_path / "map.xml", junction())
    right = imported(tmp_path, junction())
    text = (tmp_path / "map.xml").read_text()
    for side in sides:
        text = turned(text, into("W"), side)
    (tmp_path / "map.xml").write_text(text)
    capsys.readouterr()
    assert main([str(tmp_path / "map.xml"), "--out", str(tmp_path / "turned.json")]) == 0
    assert f"direction in which the bounds of lanelet {into('W')} are drawn" in capsys.readouterr().out
    np.testing.assert_array_equal(
        MapSource.read(tmp_path / "turned.json").lanes["W_in"].points, right.lanes["W_in"].points
    )


def test_a_lane_drawn_backwards_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawn = junction()
    backwards = drawn.changed(into("W"), centre=drawn.lanelets[into("W")].centre[::-1])
    write_commonroad_map(tmp_path / "map.xml", backwards)
    assert main([str(tmp_path / "map.xml"), "--out", str(tmp_path / "out.json")]) == 0
    text = capsys.readouterr().out
    assert f"of lanelet {into('W')}, for it begins 70 m from its end; is one drawn backwards?" in text
    assert not any(route.entry == "W" for route in MapSource.read(tmp_path / "out.json").routes)


def test_without_an_origin_one_is_guessed_and_around_zero_degrees_it_is_that_of_interaction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "map.osm", tmp_path / "out.json"
    write_lanelet2_map(path, junction())
    assert main([str(path), "--out", str(out)]) == 0
    assert "guessed: the middle of the map" in capsys.readouterr().out
    assert np.abs(MapSource.read(out).lanes["W_in"].points).max() < 200.0
    write_lanelet2_map(path, junction().moved(1000.0, 990.0), place=(0.0, 0.0))
    assert main([str(path), "--out", str(out)]) == 0
    assert MapSource.read(out).lanes["W_in"].points[-1] == pytest.approx([988.0, 988.25], abs=0.05)


def test_signs_on_the_first_lanelets_inside_count_where_none_stands_before(tmp_path: Path) -> None:
    drawn = junction()
    for id, one in drawn.lanelets.items():
        if id >= 1000:
            drawn = drawn.changed(id, signs=("301",) if (id - 1000) // 100 in (0, 2) else ("206",))
        assert one.successors or id >= 200
    source = imported(tmp_path, drawn)
    rights = {name: arm.right_of_way for name, arm in source.arms.items()}
    assert sorted(rights.values()) == ["priority", "priority", "stop", "stop"]
    assert rights["E"] == rights["W"]


def test_a_map_is_moved_to_where_cars_drive(tmp_path: Path) -> None:
    drawn = junction(arms=("E", "N", "W"))
    write_commonroad_map(tmp_path / "map.xml", drawn)
    lines = [drawn.lanelets[id].centre for id in (into("W"), into("E"), out_of("E"), into("N"), out_of("N"))]
    recording = driven([line + np.array([700.0, -40.0]) for line in lines])
    east, north, share = shift_to(read_commonroad(tmp_path / "map.xml"), [recording])
    assert (east, north) == pytest.approx((700.0, -40.0), abs=1.0)
    assert share > 0.9


def driven(lines: list[Any]) -> Recording:
    """Cars along lines, at 7 m/s."""
    share = np.arange(0.0, 1.0, 0.02)
    dense = [
        np.stack([np.interp(share, np.linspace(0.0, 1.0, len(line)), column) for column in line.T], axis=1)
        for line in lines
    ]
    points = np.concatenate(dense)
    way = np.concatenate([np.gradient(one, axis=0) for one in dense])
    offsets = np.cumsum([0, *map(len, dense)])
    count = len(dense)
    return Recording(
        id="00",
        location=None,
        frame_rate=5.0,
        track_id=np.arange(count),
        road_user=("car",) * count,
        length=np.full(count, 4.5),
        width=np.full(count, 1.8),
        offsets=offsets,
        frame=np.tile(np.arange(len(share)), count),
        x=points[:, 0],
        y=points[:, 1],
        velocity=way * 5.0,
        acceleration=way * 0.0,
        heading=np.arctan2(way[:, 1], way[:, 0]),
    )


def test_utm_metres_are_those_of_known_places() -> None:
    assert utm(np.zeros(1), np.array([3.0]), 31)[0] == pytest.approx([500_000.0, 0.0], abs=1e-6)
    assert utm(np.zeros(1), np.zeros(1), 31)[0] == pytest.approx([166_021.443, 0.0], abs=1e-3)
    latitude = np.radians(np.linspace(0.0, 52.0, 20_001))
    eccentricity = (2.0 - 1.0 / 298.257223563) / 298.257223563
    slope = 6378137.0 * (1.0 - eccentricity) / (1.0 - eccentricity * np.sin(latitude) ** 2) ** 1.5
    meridian = 0.9996 * float(np.trapezoid(slope, latitude))
    assert utm(np.array([52.0]), np.array([9.0]), 32)[0] == pytest.approx([500_000.0, meridian], abs=1e-3)


def test_the_written_source_has_a_line_for_each_lane_and_route(tmp_path: Path) -> None:
    imported(tmp_path, junction())
    text = (tmp_path / "out.json").read_text()
    assert len(text.splitlines()) < 60
    content = json.loads(text)
    assert content["routes"]["E-W"].keys() == {"approach", "exit", "inside"}
    assert "around" in content["about"]


def test_a_junction_of_which_no_source_can_be_made_is_not_offered(tmp_path: Path) -> None:
    """Beside the junction, ways that cross and come from nowhere."""
    one, other = junction(), junction().moved(400.0, 30.0)
    crossing = {
        id + 5000: replace(drawn, id=id + 5000, successors=()) for id, drawn in other.lanelets.items() if id >= 1000
    }
    source = imported(tmp_path, Junction(one.lanelets | crossing))
    assert {route.id for route in source.routes} == ALL
