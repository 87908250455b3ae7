"""INTERACTION's and CommonRoad's recordings give the same scenes as inD's; what is malformed is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from data.build import build, main
from data.formats import ind
from data.formats.folder import format_of, read_location, read_recording, recording_file, recording_ids
from data.recording import Recording
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scenes import Scenes
from tests.support.commonroad_protobuf import write_protobuf
from tests.support.other_formats import write_commonroad, write_interaction
from tests.support.recordings import on_route, steady, walking, write_recording

WINDOW = 60
"""Frames of 0.2 s of a scenario."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("ind")
    bendplatz = Intersection.load("bendplatz")
    movers = [
        *(on_route(bendplatz, "NW-SE", 10 + k, 7.0 * k, steady(110.0, 9.0), 9.0) for k in range(5)),
        *(on_route(bendplatz, "SE-NW", 20 + k, 7.0 * k + 2.0, steady(110.0, 8.0), 10.0) for k in range(4)),
        on_route(bendplatz, "SE-NW", 30, 12.0, steady(110.0, 5.0), 14.0, "bicycle"),
        walking(40, 1.0, (120.0, -60.0), (110.0, -60.0), 8.0),
    ]
    write_recording(folder, "07", movers)
    return ind.read_recording(folder, "07").resampled(0.2)


@pytest.fixture(params=["interaction", "commonroad", "commonroad in protobuf"])
def folder(request: pytest.FixtureRequest, tmp_path: Path, recording: Recording) -> Path:
    if request.param == "interaction":
        write_interaction(tmp_path, "003", recording)
    else:
        for begin in range(0, int(recording.frame.max()) + 1, WINDOW):
            path = tmp_path / f"XX_Place-1_{begin}.xml"
            write_commonroad(path, recording, begin, begin + WINDOW)
            if request.param == "commonroad in protobuf":
                write_protobuf(path, path.with_suffix(".pb"))
                path.unlink()
    return tmp_path


def refused(folder: Path, *words: str) -> None:
    with pytest.raises((ValueError, FileNotFoundError)) as caught:
        read_recording(folder, recording_ids(folder)[0])
    for word in words:
        assert word in str(caught.value), str(caught.value)


def test_a_recording_holds_what_was_written(folder: Path, recording: Recording) -> None:
    ids = recording_ids(folder)
    assert ids == (["003"] if format_of(folder) == "INTERACTION" else ["XX_Place-1_0"])
    assert read_location(folder, ids[0]) is None
    found = read_recording(folder, ids[0])
    assert found.frame_rate == pytest.approx(5.0)
    assert sorted(found.road_user) == sorted(recording.road_user)
    order = [int(str(id).strip("P")) % 1000 for id in found.track_id]
    for index, id in enumerate(order):
        other = recording.track_id.tolist().index(id)
        own, its = (slice(one.offsets[k], one.offsets[k + 1]) for one, k in ((found, index), (recording, other)))
        assert found.road_user[index] == recording.road_user[other]
        np.testing.assert_allclose(found.x[own], recording.x[its], atol=1e-6)
        np.testing.assert_allclose(found.velocity[own], recording.velocity[its], atol=0.05)
        assert found.frame[own].tolist() == recording.frame[its].tolist()
        assert found.length[index] == pytest.approx(recording.length[other])


def test_all_formats_give_the_same_scenes(folder: Path, tmp_path: Path, recording: Recording) -> None:
    bendplatz = Intersection.load("bendplatz")
    scenes = build(folder, bendplatz, progress=False)
    assert scenes.provenance["recordings"][0]["location"] is None
    tracks = {track.id.rpartition("/")[2].strip("P"): track for scene in scenes for track in scene.tracks}
    routes = {int(id) % 1000: bendplatz.routes[track.route].id for id, track in tracks.items()}
    assert routes == {**dict.fromkeys(range(10, 15), "NW-SE"), **dict.fromkeys([20, 21, 22, 23, 30], "SE-NW")}
    first = next(track for id, track in tracks.items() if int(id) % 1000 == 11)
    assert float(np.median(first.speed)) == pytest.approx(9.0, abs=0.1)


def test_the_command_writes_scenes_and_takes_the_map_that_is_given(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scenes.npz"
    assert main([str(folder), "--out", str(out)]) == 1
    assert "these recordings name no location; give the map of their place (--map PATH)" in capsys.readouterr().err
    assert not out.exists()
    assert main([str(folder), "--map", "bendplatz", "--out", str(out)]) == 0
    assert len(Scenes.load(out)) >= 1


def test_a_recording_far_from_the_map_is_refused_with_its_distance(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scenes.npz"
    assert main([str(folder), "--map", "t_junction", "--out", str(out)]) == 1
    message = capsys.readouterr().err
    assert 'm (median) from the routes of map "t_junction"' in message
    assert not out.exists()


def test_several_formats_in_one_folder_are_refused(folder: Path, tmp_path: Path, recording: Recording) -> None:
    (tmp_path / "00_tracks.csv").write_text("")
    with pytest.raises(ValueError, match=r"recordings of several formats: 00_tracks\.csv"):
        format_of(folder)
    with pytest.raises(FileNotFoundError, match="no recording here; wanted"):
        format_of(Path(__file__).parent)


def test_scenarios_that_do_not_follow_each_other_are_recordings_of_their_own(
    tmp_path: Path, recording: Recording
) -> None:
    for begin in (0, WINDOW, 2 * WINDOW + 40):
        write_commonroad(tmp_path / f"XX_Place-1_{begin}.xml", recording, begin, begin + WINDOW)
    assert recording_ids(tmp_path) == ["XX_Place-1_0", "XX_Place-1_160"]
    assert recording_file(tmp_path, "XX_Place-1_160").name == "XX_Place-1_160.xml"


def test_windows_are_put_together_in_the_order_of_their_numbers(tmp_path: Path, recording: Recording) -> None:
    for begin in (100, 140, 60):
        write_commonroad(tmp_path / f"XX_Place-1_{begin}.xml", recording, begin, begin + 40)
    assert recording_ids(tmp_path) == ["XX_Place-1_60"]
    assert int(read_recording(tmp_path, "XX_Place-1_60").frame.max()) == 119


@pytest.mark.parametrize(("stated", "ratio"), [("0.0333", "6.0"), ("0.4", "0.50")])
def test_a_time_step_that_contradicts_the_speeds_is_refused_with_both(
    tmp_path: Path, recording: Recording, stated: str, ratio: str
) -> None:
    path = tmp_path / "one.xml"
    write_commonroad(path, recording, 0, WINDOW)
    path.write_text(path.read_text().replace('timeStepSize="0.2"', f'timeStepSize="{stated}"'))
    refused(tmp_path, f"one.xml: at timeStepSize {stated} the tracks cover {ratio}", "a time step of 0.2 s, not")


def test_wrong_timestamps_of_interaction_are_refused(tmp_path: Path, recording: Recording) -> None:
    write_interaction(tmp_path, "000", recording)
    path = tmp_path / "vehicle_tracks_000.csv"
    table = pd.read_csv(path)
    table.assign(timestamp_ms=table["frame_id"] * 100).to_csv(path, index=False)
    (tmp_path / "pedestrian_tracks_000.csv").unlink()
    refused(tmp_path, "at 100 ms a frame (timestamp_ms)", "a time step of 0.2 s, not 0.1 s")
    time = table["timestamp_ms"].to_numpy().copy()
    time[7] += 50
    table.assign(timestamp_ms=time).to_csv(path, index=False)
    refused(tmp_path, "vehicle_tracks_000.csv, line 9: timestamp_ms is")


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("x", "", 'line 4, column "x": ""; wanted a finite number'),
        ("agent_type", "raft", 'agent_type is "raft"; wanted one of car, van'),
        ("width", "99", "line 2: length or width of track 10 changes"),
        ("frame_id", "9000", "a gap in the frames"),
        ("vx", "400", "the speed of track 10 (vx, vy) is"),
    ],
)
def test_a_bad_cell_of_interaction_is_named(
    tmp_path: Path, recording: Recording, column: str, value: str, words: str
) -> None:
    write_interaction(tmp_path, "000", recording)
    path = tmp_path / "vehicle_tracks_000.csv"
    table = pd.read_csv(path, dtype=str)
    table.loc[2 if column != "agent_type" else 0, column] = value
    table.to_csv(path, index=False)
    refused(tmp_path, "vehicle_tracks_000.csv", words)


def test_a_missing_column_of_interaction_is_named_and_more_columns_are_taken(
    tmp_path: Path, recording: Recording
) -> None:
    write_interaction(tmp_path, "000", recording)
    path = tmp_path / "vehicle_tracks_000.csv"
    table = pd.read_csv(path)
    table.assign(mood="good").to_csv(path, index=False, encoding="utf-8-sig")
    assert len(read_recording(tmp_path, "000").track_id) == len(recording.track_id)
    table.drop(columns="psi_rad").to_csv(path, index=False)
    refused(tmp_path, 'line 1: column "psi_rad" is missing')


def test_who_walks_and_who_cycles_is_told_by_speed(tmp_path: Path, recording: Recording) -> None:
    write_interaction(tmp_path, "000", recording)
    found = read_recording(tmp_path, "000")
    by_id = dict(zip(found.track_id.tolist(), found.road_user, strict=True))
    assert (by_id["P30"], by_id["P40"]) == ("bicycle", "pedestrian")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<type>car</type>", "<type>kiosk</type>", None),
        ("<exact>3</exact>", "<exact>5</exact>", "time step 5 follows 2; wanted each once, in order"),
        ("<exact>0</exact>", "<exact>-1</exact>", "time step -1; wanted a whole number from 0 to 1000000"),
        ("<x>", "<x>1000000000", "m from 0; wanted at most 1e+08"),
        ("<x>", "<z>", "not XML, or truncated"),
        ("<length>4.5</length>", "", "length: nothing; wanted a finite number"),
        ("<length>4.5</length>", "<length>-1</length>", "length of obstacle 1010 (car) is -1 m"),
        ("<rectangle>", "<rectangle><orientation>1.0</orientation>", "a rectangle turned by 1 rad"),
        ("<velocity><exact>", "<velocity><exact>x", "velocity: 'x"),
        ('id="1020"', 'id="1010"', "obstacle 1010 is there twice"),
    ],
)
def test_a_bad_scenario_is_refused_by_obstacle(
    tmp_path: Path, recording: Recording, old: str, new: str, words: str | None
) -> None:
    path = tmp_path / "one.xml"
    write_commonroad(path, recording, 0, WINDOW)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    if words is None:  # counted, not refused
        assert read_recording(tmp_path, "one").left_out == {'obstacle of type "kiosk"': 1}
    else:
        refused(tmp_path, "one.xml", words)


def test_a_scenario_without_obstacles_is_refused(tmp_path: Path) -> None:
    (tmp_path / "one.xml").write_text('<commonRoad timeStepSize="0.1"/>')
    refused(tmp_path, "one.xml: no obstacle that moves (0 that stand); wanted a scenario with traffic")
    (tmp_path / "one.xml").write_text("<commonRoad/>")
    refused(tmp_path, "one.xml: timeStepSize: nothing; wanted a finite number")


def test_a_standing_obstacle_is_there_all_along(tmp_path: Path, recording: Recording) -> None:
    path = tmp_path / "one.xml"
    write_commonroad(path, recording, 0, WINDOW)
    state = (
        "<position><point><x>5.0</x><y>6.0</y></point></position><orientation><exact>1.0</exact></orientation>"
        "<time><exact>0</exact></time><velocity><exact>0.0</exact></velocity>"
    )
    shape = "<shape><rectangle><length>4.0</length><width>2.0</width></rectangle></shape>"
    parked = (
        f'<staticObstacle id="9"><type>parkedVehicle</type>{shape}<initialState>{state}</initialState></staticObstacle>'
    )
    path.write_text(path.read_text().replace("</commonRoad>", f"{parked}</commonRoad>"))
    found = read_recording(tmp_path, "one")
    index = found.track_id.tolist().index("9")
    rows = slice(found.offsets[index], found.offsets[index + 1])
    assert found.road_user[index] == "car"
    assert found.frame[rows].tolist() == list(range(int(found.frame.max()) + 1))
    assert set(found.x[rows].tolist()) == {5.0}
    path.write_text(path.read_text().replace('<staticObstacle id="9">', '<staticObstacle id="1010">'))
    refused(tmp_path, "one.xml: obstacle 1010 is there twice")
