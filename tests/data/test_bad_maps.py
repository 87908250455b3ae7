"""Maps of lanes that are damaged, lie elsewhere or hold no junction are refused by name, and nothing is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.maps.__main__ import main
from intersection_env.maps.source_values import LARGEST
from tests.support.imported_maps import refused
from tests.support.lane_maps import (
    Junction,
    junction,
    origin,
    write_commonroad_map,
    write_lanelet2_map,
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not XML, or truncated"),
        ("<osm></osm>", "the root element is <osm>; wanted <commonRoad>"),
        ("<commonRoad/>", "no lanelet on which cars drive"),
        ('<commonRoad><lanelet id="7"><leftBound/></lanelet></commonRoad>', "lanelet 7, leftBound: 0 points"),
        (
            '<commonRoad><lanelet id="7"><leftBound><point><x>a</x><y>0</y></point></leftBound></lanelet></commonRoad>',
            "lanelet 7, leftBound: 'a'; wanted a finite number",
        ),
        (
            '<commonRoad><lanelet id="7"><leftBound><point><x>1e9</x><y>0</y></point></leftBound></lanelet>'
            "</commonRoad>",
            "lanelet 7, leftBound: a point 1e+09 m from 0; wanted at most 1e+08",
        ),
        (
            '<commonRoad><lanelet id="7"><leftBound><point><x>0</x><y>0</y></point><point><x>9</x><y>2e5</y></point>'
            "</leftBound></lanelet></commonRoad>",
            "lanelet 7, leftBound: points 200000 m apart; wanted at most 100000",
        ),
    ],
)
def test_a_damaged_map_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str) -> None:
    (tmp_path / "map.xml").write_text(text)
    assert words in refused(tmp_path, capsys, tmp_path / "map.xml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('role="left"', 'role="middle"', "lanelet 100, left bound is missing"),
        ('<nd ref="1"/>', '<nd ref="99999"/>', "lanelet 100, left bound: node 99999 of way 50000 is not in the file"),
        ('lat="49.5', 'lat="149.5', "node 1 lies at 149.5"),
        ('lat="49.5', 'lat="x49.5', "node 1, lat: 'x49.5"),
        ('ref="50000"', 'ref="77"', "lanelet 100, left bound: way 77 is not in the file"),
        ("</osm>", "", "not XML, or truncated"),
    ],
)
def test_a_damaged_lanelet2_map_is_refused_by_lanelet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str
) -> None:
    path = tmp_path / "map.osm"
    write_lanelet2_map(path, junction())
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    assert words in refused(tmp_path, capsys, path, "--origin", "{},{}".format(*origin()))


def test_a_map_of_other_metres_is_refused_with_its_distance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_commonroad_map(tmp_path / "map.xml", junction().moved(300_000.0, 400_000.0))
    assert "500.0 km from 0" in refused(tmp_path, capsys, tmp_path / "map.xml")
    small = junction()
    tiny = Junction({id: replace(one, centre=one.centre * 1e-4, width=1e-4) for id, one in small.lanelets.items()})
    write_commonroad_map(tmp_path / "map.xml", tiny)
    assert "map.xml: " in refused(tmp_path, capsys, tmp_path / "map.xml")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--around", "1,2"), '--around: "1,2"; wanted 3 numbers'),
        (("--around", "0,0,-5"), "a radius of -5 m"),
        (("--around", "900,0,5"), "no lanes cross or merge around"),
        (("--origin", "1,2"), "--origin is for Lanelet2 maps"),
        (("--shift", "nan,0"), "--shift"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, str], words: str
) -> None:
    write_commonroad_map(tmp_path / "map.xml", junction())
    assert words in refused(tmp_path, capsys, tmp_path / "map.xml", *options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--name", "two words"), 'error: "name" must be one word'),
        (("--name", "a/b"), 'error: "name" must be one word of letters, digits'),
        (("--name", ""), 'error: "name" must be one word'),
        (("--locations", "-1"), 'error: "locations" must be a list of integers'),
    ],
)
def test_arguments_are_checked_before_the_map_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], message: str
) -> None:
    assert main([str(tmp_path / "nowhere.osm"), "--out", str(tmp_path / "out.json"), *options]) == 1
    assert capsys.readouterr().err.startswith(message)


def test_a_source_that_nobody_can_read_is_refused_by_the_name_that_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The middle of the map is within reach, but not the lanes of its eastern arm."""
    write_commonroad_map(tmp_path / "map.xml", junction().moved(LARGEST - 20.0, 0.0))
    message = refused(tmp_path, capsys, tmp_path / "map.xml")
    assert message.startswith(f"error: {tmp_path / 'out.json'}: ")
    assert "E_" in message


def test_a_source_that_does_not_compile_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    aside = {"W_in": np.array([[0.0, 50.0], [1.0, 50.0]])}
    monkeypatch.setattr("data.maps.source_of._decided", lambda source, *_: replace(source, stop_lines=aside))
    write_commonroad_map(tmp_path / "map.xml", junction())
    message = refused(tmp_path, capsys, tmp_path / "map.xml")
    assert message.startswith(f"error: {tmp_path / 'out.json'}: ")
    assert 'must cross the stop line of "W_in" once' in message


def test_where_no_junction_can_be_used_each_is_named_with_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inside = {id: replace(drawn, successors=()) for id, drawn in junction().lanelets.items() if id >= 1000}
    away = {id + 5000: replace(one, id=id + 5000) for id, one in Junction(inside).moved(400.0, 30.0).lanelets.items()}
    write_commonroad_map(tmp_path / "map.xml", Junction(inside | away))
    message = refused(tmp_path, capsys, tmp_path / "map.xml")
    assert "2 junctions are on this map, and none can be used:" in message
    assert message.count("around ") == 2
