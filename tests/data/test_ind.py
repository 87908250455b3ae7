"""inD's files are read as they are, and anything else is refused by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from data.formats.ind import read_location, read_recording, recording_ids
from intersection_env.maps.intersection import Intersection
from tests.support.recordings import Mover, on_route, steady, walking, write_recording

Edit = Callable[[pd.DataFrame], pd.DataFrame]


@pytest.fixture(scope="module")
def movers() -> list[Mover]:
    bendplatz = Intersection.load("bendplatz")
    return [
        on_route(bendplatz, "NW-SE", 3, 0.0, steady(120.0, 10.0), 6.0),
        on_route(bendplatz, "SE-NW", 7, 2.0, steady(115.0, 4.0), 5.0, "bicycle"),
        walking(9, 1.0, (70.0, -60.0), (60.0, -60.0), 4.0),
    ]


@pytest.fixture
def folder(tmp_path: Path, movers: list[Mover]) -> Path:
    write_recording(tmp_path, "07", movers)
    return tmp_path


def edit(path: Path, change: Edit) -> None:
    change(pd.read_csv(path)).to_csv(path, index=False)


def edit_cell(path: Path, line: int, column: str, cell: str) -> None:
    lines = path.read_text().splitlines()
    cells = lines[line - 1].split(",")
    cells[lines[0].split(",").index(column)] = cell
    lines[line - 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")


def refused(folder: Path, *words: str) -> None:
    """The recording is refused with one ValueError that holds each of the words."""
    with pytest.raises(ValueError, match="07_") as caught:
        read_recording(folder, "07")
    for word in words:
        assert word in str(caught.value), str(caught.value)


@pytest.mark.parametrize("suffix", [".csv", ".csv.xz"])
def test_recording_holds_what_was_written(tmp_path: Path, movers: list[Mover], suffix: str) -> None:
    write_recording(tmp_path, "07", movers, suffix=suffix)
    recording = read_recording(tmp_path, "07")
    assert recording_ids(tmp_path) == ["07"]
    assert read_location(tmp_path, "07") == 1
    assert (recording.id, recording.location, recording.frame_rate) == ("07", 1, 25.0)
    assert recording.track_id.tolist() == [3, 7, 9]
    assert recording.road_user == ("car", "bicycle", "pedestrian")
    assert recording.length.tolist() == [4.5, 0.0, 0.0]
    for index, mover in enumerate(movers):
        rows = slice(recording.offsets[index], recording.offsets[index + 1])
        assert recording.frame[rows].tolist() == list(range(mover.first_frame, mover.first_frame + len(mover.centre)))
        assert np.abs(np.stack([recording.x[rows], recording.y[rows]], axis=1) - mover.centre).max() < 1e-5


def test_resampling_keeps_every_fifth_frame_exactly(folder: Path) -> None:
    recording = read_recording(folder, "07")
    sampled = recording.resampled(0.2)
    assert sampled.frame_rate == 5.0
    assert np.array_equal(sampled.x, recording.x[recording.frame % 5 == 0])
    assert np.array_equal(sampled.frame, recording.frame[recording.frame % 5 == 0] // 5)
    with pytest.raises(ValueError, match=r"recording 07: frameRate 25 has no whole number of frames in 0\.1 s"):
        recording.resampled(0.1)


def test_missing_folder_and_empty_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such folder"):
        recording_ids(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError, match=re.escape(f"{tmp_path}: no recording here")):
        recording_ids(tmp_path)


@pytest.mark.parametrize("kind", ["tracks", "tracksMeta", "recordingMeta"])
def test_missing_file_is_named(folder: Path, kind: str) -> None:
    (folder / f"07_{kind}.csv").unlink()
    with pytest.raises(FileNotFoundError, match=f"07_{kind}.csv: missing"):
        read_recording(folder, "07")


def test_file_that_is_there_twice_is_refused(folder: Path) -> None:
    (folder / "07_tracks.csv.xz").write_bytes(b"")
    refused(folder, "07_tracks.csv", "keep one of the two")


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_truncated_xz_is_refused(tmp_path: Path, movers: list[Mover], share: float) -> None:
    write_recording(tmp_path, "07", movers, suffix=".csv.xz")
    path = tmp_path / "07_tracks.csv.xz"
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    refused(tmp_path, "07_tracks.csv.xz")


def test_corrupt_xz_is_refused(tmp_path: Path, movers: list[Mover]) -> None:
    write_recording(tmp_path, "07", movers, suffix=".csv.xz")
    path = tmp_path / "07_tracks.csv.xz"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))
    refused(tmp_path, "07_tracks.csv.xz", "damaged or truncated")


@pytest.mark.parametrize("kind", ["tracks", "tracksMeta", "recordingMeta"])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.5])
def test_truncated_csv_is_refused(folder: Path, kind: str, share: float) -> None:
    path = folder / f"07_{kind}.csv"
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    refused(folder, f"07_{kind}.csv")


def test_csv_truncated_at_a_line_is_refused(folder: Path) -> None:
    path = folder / "07_tracks.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-3]))
    refused(folder, "07_tracksMeta.csv, line 4", "finalFrame of track 9 is 125", "has 122")


def test_binary_file_is_refused(folder: Path) -> None:
    (folder / "07_tracks.csv").write_bytes(bytes(range(256)) * 40)
    refused(folder, "07_tracks.csv", "damaged or truncated")


@pytest.mark.parametrize(
    ("kind", "column"),
    [("tracks", "xCenter"), ("tracks", "yAcceleration"), ("tracksMeta", "class"), ("recordingMeta", "frameRate")],
)
def test_missing_column_is_named(folder: Path, kind: str, column: str) -> None:
    edit(folder / f"07_{kind}.csv", lambda table: table.rename(columns={column: column.upper()}))
    refused(folder, f"07_{kind}.csv, line 1", f'column "{column}" is missing', column.upper())


@pytest.mark.parametrize("cell", ["", "nan", "inf", "-inf", "fast", "1e999", "1.2.3"])
def test_cell_that_is_no_finite_number_is_named(folder: Path, cell: str) -> None:
    edit_cell(folder / "07_tracks.csv", 42, "xVelocity", cell)
    refused(folder, "07_tracks.csv, line 42", 'column "xVelocity"', f'"{cell}"', "wanted a finite number")


@pytest.mark.parametrize("cell", ["", "12.5", "seven", "nan", "99999999999999999999"])
def test_cell_that_is_no_whole_number_is_named(folder: Path, cell: str) -> None:
    edit_cell(folder / "07_tracks.csv", 42, "frame", cell)
    refused(folder, "07_tracks.csv, line 42", 'column "frame"', f'"{cell}"', "wanted a whole number")


def test_row_with_too_many_cells_is_named(folder: Path) -> None:
    path = folder / "07_tracks.csv"
    lines = path.read_text().splitlines()
    lines[9] += ",1.0"
    path.write_text("\n".join(lines) + "\n")
    refused(folder, "07_tracks.csv, line 10", "18 cells, the header has 17")


def test_frames_out_of_order_are_named(folder: Path) -> None:
    def swap(table: pd.DataFrame) -> pd.DataFrame:
        order = list(range(len(table)))
        order[20], order[21] = 21, 20
        return table.iloc[order]

    edit(folder / "07_tracks.csv", swap)
    refused(folder, "07_tracks.csv, line 22", "frames out of order", "frame 21 of track 3 follows frame 19")


def test_repeated_frame_is_named(folder: Path) -> None:
    edit(folder / "07_tracks.csv", lambda table: table.iloc[[*range(21), 20, *range(21, len(table))]])
    refused(folder, "07_tracks.csv, line 23", "frames out of order", "frame 20 of track 3 follows frame 20")


def test_gap_in_the_frames_is_named(folder: Path) -> None:
    edit(folder / "07_tracks.csv", lambda table: table.drop(index=[30, 31]))
    refused(folder, "07_tracks.csv, line 32", "a gap in the frames", "frame 32 of track 3 follows frame 29")


def test_duplicate_track_is_named_in_tracks(folder: Path) -> None:
    edit(folder / "07_tracks.csv", lambda table: pd.concat([table, table[table["trackId"] == 3]]))
    refused(folder, "07_tracks.csv, line 380", "duplicate track 3", "began in line 2")


def test_duplicate_track_is_named_in_meta(folder: Path) -> None:
    edit(folder / "07_tracksMeta.csv", lambda table: pd.concat([table, table.iloc[:1]]))
    refused(folder, "07_tracksMeta.csv, line 5", "track 3 is there twice, first in line 2")


@pytest.mark.parametrize(
    ("column", "cell", "wanted"),
    [
        ("length", "-4.5", "0.1 to 50"),
        ("width", "-1.0", "0.1 to 10"),
        ("length", "0.0", "0.1 to 50"),
        ("length", "450", "0.1 to 50"),
        ("length", "0.05", "0.1 to 50"),
        ("width", "0.05", "0.1 to 10"),
        ("width", "11.0", "0.1 to 10"),
    ],
)
def test_size_of_a_car_must_be_one_that_the_core_takes(folder: Path, column: str, cell: str, wanted: str) -> None:
    edit_cell(folder / "07_tracksMeta.csv", 2, column, cell)
    refused(folder, "07_tracksMeta.csv, line 2", f"{column} of track 3 (car) is", f"wanted {wanted}")


@pytest.mark.parametrize("cell", ["100.5", "-360", "1e300"])
def test_speed_that_the_core_would_refuse_is_named(folder: Path, cell: str) -> None:
    edit_cell(folder / "07_tracks.csv", 42, "xVelocity", cell)
    refused(folder, "07_tracks.csv, line 42", "the speed of track 3", "m/s; wanted at most 100")


def test_equal_recording_numbers_are_refused(folder: Path) -> None:
    (folder / "7_tracks.csv.xz").write_bytes(b"")
    with pytest.raises(ValueError, match=r"07_tracks\.csv and 7_tracks\.csv have equal numbers; keep one"):
        recording_ids(folder)


@pytest.mark.parametrize("kind", ["tracks", "tracksMeta", "recordingMeta"])
def test_file_that_begins_with_a_byte_order_mark_is_read(folder: Path, kind: str) -> None:
    path = folder / f"07_{kind}.csv"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_recording(folder, "07").track_id.tolist() == [3, 7, 9]


def test_negative_length_in_tracks_is_named(folder: Path) -> None:
    edit_cell(folder / "07_tracks.csv", 17, "length", "-4.5")
    refused(folder, "07_tracks.csv, line 17", "length is -4.5 m")


@pytest.mark.parametrize(
    ("column", "cell"),
    [("initialFrame", "1"), ("finalFrame", "149"), ("numFrames", "150"), ("length", "4.8"), ("width", "2.0")],
)
def test_meta_that_disagrees_with_tracks_is_named(folder: Path, column: str, cell: str) -> None:
    edit_cell(folder / "07_tracksMeta.csv", 2, column, cell)
    refused(folder, "07_tracksMeta.csv, line 2", f"{column} of track 3 is {cell.removesuffix('.0')}")


def test_track_in_one_file_only_is_named(folder: Path) -> None:
    edit(folder / "07_tracksMeta.csv", lambda table: table[table["trackId"] != 7])
    refused(folder, "07_tracksMeta.csv", "track 7 of 07_tracks.csv is missing")


def test_track_without_rows_is_named(folder: Path) -> None:
    edit(folder / "07_tracks.csv", lambda table: table[table["trackId"] != 7])
    refused(folder, "07_tracks.csv", "track 7 of 07_tracksMeta.csv is missing")


def test_unknown_class_is_named(folder: Path) -> None:
    edit_cell(folder / "07_tracksMeta.csv", 3, "class", "raft")
    refused(folder, "07_tracksMeta.csv, line 3", 'class is "raft"', "car, van", "truck_bus", "bicycle, pedestrian")


@pytest.mark.parametrize(
    ("word", "known"), [("van", "car"), ("motorcycle", "car"), ("bus", "truck_bus"), ("trailer", "truck_bus")]
)
def test_class_of_other_data_sets_has_its_place(folder: Path, word: str, known: str) -> None:
    edit_cell(folder / "07_tracksMeta.csv", 2, "class", word)
    assert read_recording(folder, "07").road_user[0] == known


@pytest.mark.parametrize("rate", ["24", "29.97", "0", "-25"])
def test_frame_rate_without_whole_steps_is_refused(folder: Path, rate: str) -> None:
    edit_cell(folder / "07_recordingMeta.csv", 2, "frameRate", rate)
    refused(folder, "07_recordingMeta.csv", f"frameRate is {rate}")


def test_frame_rate_that_the_velocities_contradict_is_refused(folder: Path) -> None:
    edit_cell(folder / "07_recordingMeta.csv", 2, "frameRate", "30")
    refused(folder, "07_recordingMeta.csv", "at frameRate 30 the tracks cover 1.20 times the way")


def test_recording_id_of_another_recording_is_refused(folder: Path) -> None:
    edit_cell(folder / "07_tracks.csv", 5, "recordingId", "8")
    refused(folder, "07_tracks.csv, line 5", "recordingId is 8, the file's name says 07")


def test_frames_beyond_the_duration_are_refused(folder: Path) -> None:
    edit_cell(folder / "07_recordingMeta.csv", 2, "duration", "3.0")
    refused(folder, "07_recordingMeta.csv", "duration 3 s at frameRate 25 ends before frame 175")
