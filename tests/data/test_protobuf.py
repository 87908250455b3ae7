"""CommonRoad's protobuf files: those that commonroad-io wrote are read as their XML, and bad ones are refused by name.

The files in tests/data/commonroad are of `tests.support.commonroad_scenario`, written by commonroad-io 2024.3
(scenario.pb) and 2026.1 (the others): `python -m tests.commonroad --keep`.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.build import main as build
from data.formats.commonroad import read_commonroad
from data.formats.commonroad_parts import read_part
from data.formats.folder import read_recording, recording_file, recording_ids
from data.maps.__main__ import main as maps
from data.maps.commonroad_file import read_commonroad as read_map
from data.recording import Recording
from tests.support.commonroad_protobuf import write_protobuf
from tests.support.commonroad_scenario import assert_same_map, assert_same_recording, write_made_scenario
from tests.support.lane_maps import junction, write_commonroad_map

FILES = Path(__file__).with_name("commonroad")
Change = Callable[[Any], None]


@pytest.fixture
def xml(tmp_path: Path) -> Path:
    write_made_scenario(tmp_path / "made.xml")
    return tmp_path / "made.xml"


def changed(tmp_path: Path, name: str, change: Change) -> Path:
    """A file in a folder of its own, with its message changed."""
    message = read_part(FILES / name).message
    change(message)
    path = tmp_path / "changed" / name
    path.parent.mkdir()
    path.write_bytes(message.SerializePartialToString())
    return path


def read_recording_alone(path: Path) -> Recording:
    return read_commonroad([path])


def refusal(read: Callable[[], object]) -> str | None:
    """What is said of a file that is refused; None if it is read."""
    try:
        read()
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("name", ["scenario.pb", "dynamic.pb"])
def test_recordings_that_commonroad_io_wrote_are_read_as_their_xml(xml: Path, name: str) -> None:
    assert_same_recording(xml, FILES / name)


@pytest.mark.parametrize("name", ["scenario.pb", "map.pb"])
def test_maps_that_commonroad_io_wrote_are_read_as_their_xml(xml: Path, name: str) -> None:
    assert_same_map(xml, FILES / name)


def test_what_is_read_is_what_the_scenario_holds() -> None:
    found = read_commonroad([FILES / "scenario.pb"])
    assert dict(zip(found.track_id.tolist(), found.road_user, strict=True)) == {
        "101": "car", "102": "truck_bus", "103": "truck_bus", "104": "bicycle", "105": "pedestrian", "106": "car",
    }  # fmt: skip
    assert found.left_out == {'obstacle of type "constructionZone"': 1}
    lanelets = read_map(FILES / "scenario.pb").lanelets
    assert lanelets["1"].speed_limit == 13.89
    assert [set(lanelets[id].signs) for id in ("1", "3")] == [{"priority"}, {"yield"}]
    stop_line = lanelets["3"].stop_line
    assert stop_line is not None
    assert stop_line.tolist() == [[58.25, -8.0], [61.75, -8.0]]


def test_of_three_files_the_one_with_obstacles_is_the_recording(tmp_path: Path) -> None:
    for name in ("map.pb", "dynamic.pb", "problems.pb"):
        shutil.copy(FILES / name, tmp_path / name)
    assert recording_ids(tmp_path) == ["dynamic"]
    assert recording_file(tmp_path, "dynamic") == tmp_path / "dynamic.pb"
    (tmp_path / "dynamic.pb").unlink()
    with pytest.raises(ValueError, match=r"map\.pb: no obstacles here, nor in another file of this folder"):
        recording_ids(tmp_path)


def test_a_map_gives_the_same_source_from_both(tmp_path: Path) -> None:
    drawn = junction().changed(100, signs=("206",)).changed(110, signs=("301", "274=13.89"))
    write_commonroad_map(tmp_path / "map.xml", drawn)
    write_protobuf(tmp_path / "map.xml", tmp_path / "map.pb")
    texts = []
    for file in ("map.xml", "map.pb"):
        assert maps([str(tmp_path / file), "--name", "place", "--out", str(tmp_path / f"{file}.json")]) == 0
        texts.append((tmp_path / f"{file}.json").read_text().replace(file, "map"))
    assert texts[0] == texts[1]


def test_a_part_without_lanelets_makes_no_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("dynamic.pb", "problems.pb"):
        assert maps([str(FILES / name), "--out", str(tmp_path / "place.json")]) == 1
        assert f"{name}: no lanelet on which cars drive; where a scenario is three files" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_xml_and_protobuf_in_one_folder_are_refused(tmp_path: Path, xml: Path) -> None:
    shutil.copy(FILES / "scenario.pb", tmp_path / "scenario.pb")
    with pytest.raises(
        ValueError, match=r"made\.xml \(CommonRoad\), scenario\.pb \(CommonRoad in protobuf\); give each"
    ):
        recording_ids(tmp_path)


def set_based(message: Any) -> None:
    message.dynamic_obstacles[2].ClearField("trajectory_prediction")
    message.dynamic_obstacles[2].set_based_prediction.SetInParent()


def of_version(message: Any) -> None:
    message.information.common_road_version = b"2019a"


def of_other_version(message: Any) -> None:
    message.dynamic_meta_information.benchmark_id.scenario_version = b"2024b"


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("scenario.pb", of_version, 'CommonRoad version "2019a"; wanted 2018b or 2020a'),
        ("dynamic.pb", of_other_version, 'CommonRoad version "2024b"; wanted 2018b or 2020a'),
        (
            "scenario.pb",
            lambda one: one.dynamic_obstacles[1].initial_state.ClearField("time_step"),
            "dynamic_obstacles[1].initial_state.time_step is missing; wanted a complete scenario",
        ),
        (
            "dynamic.pb",
            lambda one: one.dynamic_obstacles[0].shape.rectangle.Clear(),
            "dynamic_obstacles[0].shape.rectangle.length is missing, as 1 more; wanted a complete dynamic part",
        ),
        ("scenario.pb", set_based, "obstacle 103: occupancySet, which is a prediction; wanted the trajectory"),
        ("dynamic.pb", set_based, "obstacle 103: occupancySet, which is a prediction; wanted the trajectory"),
        (
            "scenario.pb",
            lambda one: one.dynamic_obstacles[0].initial_state.ClearField("point"),
            "obstacle 101, time step 0: no position/point; wanted an exact position",
        ),
        (
            "scenario.pb",
            lambda one: one.dynamic_obstacles[0].initial_state.velocity.Clear(),
            "obstacle 101, time step 0, velocity: nothing; wanted a finite number",
        ),
        (
            "scenario.pb",
            lambda one: setattr(one.dynamic_obstacles[0].initial_state.point, "x", np.nan),
            "obstacle 101, time step 0, position: 'nan'; wanted a finite number",
        ),
        (
            "dynamic.pb",
            lambda one: one.dynamic_obstacles[0].shape.Clear(),
            "obstacle 101: 0 shapes; wanted one rectangle, circle or polygon",
        ),
        (
            "scenario.pb",
            lambda one: one.ClearField("dynamic_obstacles"),
            "no obstacle that moves (2 that stand); wanted a scenario with traffic",
        ),
        (
            "scenario.pb",
            lambda one: setattr(one.information, "time_step_size", 0.0),
            "timeStepSize is 0 s; wanted 0.001 to 1",
        ),
    ],
)
def test_a_bad_recording_is_refused_by_name_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, change: Change, words: str
) -> None:
    path = changed(tmp_path, name, change)
    out = tmp_path / "scenes.npz"
    assert build([str(path.parent), "--map", "bendplatz", "--out", str(out)]) == 1
    assert f"{path}: {words}" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == [path.parent]


def short_bound(message: Any) -> None:
    del message.boundaries[0].points[1:]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda one: one.ClearField("boundaries"), "lanelet 1: left_bound is "),
        (
            lambda one: one.ClearField("stop_lines"),
            "lanelet 3: stop_line is 114; wanted the id of one of the stop_lines",
        ),
        (
            lambda one: one.lanelets[0].ClearField("right_bound"),
            "lanelets[0].right_bound is missing; wanted a complete",
        ),
        (lambda one: one.stop_lines[0].ClearField("end_point"), "stop_lines[0].end_point is missing"),
        (short_bound, "lanelet 1, leftBound: 1 points"),
        (lambda one: one.ClearField("lanelets"), "no lanelet on which cars drive"),
    ],
)
def test_a_bad_map_is_refused_by_name_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Change, words: str
) -> None:
    path = changed(tmp_path, "map.pb", change)
    assert maps([str(path), "--out", str(tmp_path / "place.json")]) == 1
    assert f"{path}: {words}" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == [path.parent]


def test_a_bound_that_is_said_to_be_reversed_is_turned(tmp_path: Path) -> None:
    def reverse(message: Any) -> None:
        for one in message.boundaries:
            points = [(point.x, point.y) for point in one.points][::-1]
            del one.points[:]
            for x, y in points:
                one.points.add(x=x, y=y)
        for one in message.lanelets:
            one.left_bound_reverse = one.right_bound_reverse = True

    assert_same_map(FILES / "map.pb", changed(tmp_path, "map.pb", reverse))


@pytest.mark.parametrize(
    ("country", "number", "sign"),
    [
        (b"USA", 17, "stop"),
        (b"USA", 241, "stop"),
        (b"AUS", 16, "yield"),
        (b"DEU", 71, "priority"),
        (b"XYZ", 70, "priority"),
    ],
)
def test_signs_of_maps_are_those_of_their_country(tmp_path: Path, country: bytes, number: int, sign: str) -> None:
    def change(message: Any) -> None:
        message.map_meta_information.map_id.country_id = country
        for one in message.traffic_signs:
            if one.traffic_sign_id == 32:
                one.traffic_sign_elements[0].element_id = number

    assert read_map(changed(tmp_path, "map.pb", change)).lanelets["3"].signs == {sign}


def test_numbers_that_are_not_known_are_counted(tmp_path: Path) -> None:
    def change(message: Any) -> None:
        message.dynamic_obstacles[0].obstacle_type = 99
        for one in message.traffic_signs:
            del one.traffic_sign_elements[0].additional_values[:]
            one.traffic_sign_elements[0].spain_element_id = 7
            one.traffic_sign_elements[0].ClearField("germany_element_id")
            one.traffic_sign_elements[0].ClearField("zamunda_element_id")

    path = changed(tmp_path, "scenario.pb", change)
    assert read_commonroad([path]).left_out['obstacle of type "number 99"'] == 1
    assert read_map(path).ignored["traffic sign number 7 (spain)"] == 4


@pytest.mark.parametrize("name", ["scenario.pb", "map.pb", "dynamic.pb"])
def test_a_truncated_file_is_refused_wherever_it_ends_in_a_message(tmp_path: Path, name: str) -> None:
    content = (FILES / name).read_bytes()
    path = tmp_path / name
    refused = 0
    for end in range(0, len(content), 5):
        path.write_bytes(content[:end])
        message = refusal(lambda: read_part(path))
        if message is None:  # it ends between two messages, which nothing tells
            assert read_part(path).message.ByteSize() == end
        else:
            assert message.startswith(f"{path}: ")
            refused += 1
    assert refused > 0.9 * len(content) / 5


@pytest.mark.parametrize("content", [b"", b"\x0a\x00", b"<commonRoad/>", bytes(range(256)), b"\xff" * 64])
def test_what_is_no_commonroad_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "one.pb").write_bytes(content)
    with pytest.raises(ValueError, match=r"one\.pb: not CommonRoad's protobuf, or truncated; wanted a scenario"):
        recording_ids(tmp_path)


@pytest.mark.parametrize("name", ["scenario.pb", "map.pb", "dynamic.pb"])
def test_damaged_bytes_end_in_one_error_that_names_the_file_or_in_none(tmp_path: Path, name: str) -> None:
    content = (FILES / name).read_bytes()
    generator = np.random.default_rng(7)
    refused = 0
    for number in range(300):
        damaged = np.frombuffer(content, np.uint8).copy()
        damaged[generator.integers(len(content), size=3)] = generator.integers(256, size=3)
        path = tmp_path / f"{number}.pb"
        path.write_bytes(damaged.tobytes())
        for read in (read_recording_alone, read_map):
            message = refusal(partial(read, path))
            assert message is None or message.startswith(f"{path}: "), message
            refused += message is not None
    assert refused > 300


def test_a_prediction_in_xml_is_refused_too(tmp_path: Path, xml: Path) -> None:
    text = xml.read_text()
    begin, end = text.index("<trajectory>"), text.index("</trajectory>") + len("</trajectory>")
    xml.write_text(f"{text[:begin]}<occupancySet/>{text[end:]}")
    with pytest.raises(ValueError, match=r"made\.xml: obstacle 101: occupancySet, which is a prediction"):
        read_recording(tmp_path, "made")
    xml.write_text(text.replace('commonRoadVersion="2020a"', 'commonRoadVersion="2017a"'))
    with pytest.raises(ValueError, match=r'made\.xml: CommonRoad version "2017a"; wanted 2018b or 2020a'):
        read_recording(tmp_path, "made")
