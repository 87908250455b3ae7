"""The simulated recordings that ship: reproducible, in inD's format, on the map's routes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from numpy.typing import NDArray

from data.describe.speeds import slowest_in_junction
from data.sumo import generate as sumo
from data.sumo import network as sumo_network
from data.sumo import recording_files as sumo_files
from data.sumo import tracks as sumo_tracks
from data.sumo.network import CORNERING
from data.sumo.places import BENDPLATZ, NUMBERS, PLACES, place_of
from intersection_env.maps.source import MapSource
from intersection_env.scenes.scenes import Scenes

TRACKS = (
    "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,"
    "xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration"
)
TRACKS_META = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class"
RECORDING_META = (
    "recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks,numVehicles,numVRUs,"
    "latLocation,lonLocation,xUtmOrigin,yUtmOrigin,orthoPxToMeter"
)
REGENERATED = 0  # a recording that is drawn at its first seed
LATERAL_TOLERANCE = 0.3  # [m]
SWERVING_TRACKS = 4  # in a recording: those that pass its one bicycle
FOLDER = sumo.RECORDINGS


@pytest.fixture(scope="module")
def settings() -> dict[str, Any]:
    content: dict[str, Any] = json.loads((FOLDER / "settings.json").read_text(encoding="utf-8"))
    return content


@pytest.fixture(scope="module")
def recordings() -> dict[int, pd.DataFrame]:
    """Every recording's tracks with their class, every fifth frame."""
    tables = {}
    for number in NUMBERS:
        table = pd.read_csv(FOLDER / f"{number:02d}_tracks.csv.xz")
        meta = pd.read_csv(FOLDER / f"{number:02d}_tracksMeta.csv").set_index("trackId")
        assert ",".join(table.columns) == TRACKS
        first, size = table.groupby("trackId").frame.min(), table.groupby("trackId").size()
        assert (first == meta.initialFrame).all()
        assert (size == meta.numFrames).all()
        assert first.is_monotonic_increasing
        assert list(meta.index) == list(range(len(meta)))
        table = table[table.frame % 5 == 0].copy()
        table["class"] = meta["class"].reindex(table.trackId).to_numpy()
        tables[number] = table
    return tables


def test_a_recording_is_regenerated_to_the_same_bytes(tmp_path: Path) -> None:
    sumo.generate(REGENERATED, tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert len(names) == 3
    for name in names:
        assert sumo_files.uncompressed(tmp_path / name) == sumo_files.uncompressed(FOLDER / name), name


def test_settings_hold_the_checksum_of_every_file(settings: dict[str, Any]) -> None:
    files = {path.name for path in FOLDER.iterdir()} - {"settings.json"}
    assert files == set(settings["sha256"])
    assert len(files) == 3 * len(NUMBERS)
    for name, checksum in settings["sha256"].items():
        assert hashlib.sha256(sumo_files.uncompressed(FOLDER / name)).hexdigest() == checksum, name


def test_the_split_is_disjoint_and_complete(settings: dict[str, Any]) -> None:
    split = settings["split"]
    assert {name: len(members) for name, members in split.items()} == {"train": 24, "development": 7, "validation": 9}
    assert sorted(int(member) for members in split.values() for member in members) == NUMBERS
    of_bendplatz = {name: sum(member in settings["maps"]["bendplatz"] for member in split[name]) for name in split}
    assert of_bendplatz == {"train": 12, "development": 3, "validation": 5}


def test_meta_files_have_inds_columns_in_order() -> None:
    for number in NUMBERS:
        assert ",".join(pd.read_csv(FOLDER / f"{number:02d}_tracksMeta.csv").columns) == TRACKS_META
        meta = pd.read_csv(FOLDER / f"{number:02d}_recordingMeta.csv")
        assert ",".join(meta.columns) == RECORDING_META
        assert (meta.locationId[0], meta.frameRate[0], meta.duration[0]) == (place_of(number).location, 25, 720.0)


def test_every_class_occurs_in_every_part_of_the_split(
    recordings: dict[int, pd.DataFrame], settings: dict[str, Any]
) -> None:
    for members in settings["split"].values():
        found = {one for member in members for one in recordings[int(member)]["class"].unique()}
        assert found == {"car", "truck_bus", "bicycle", "pedestrian"}


def test_vehicles_drive_within_03_m_of_a_route_unless_they_pass_a_bicycle(recordings: dict[int, pd.DataFrame]) -> None:
    lines_of = {}
    for place in PLACES:
        source = MapSource.read(place.source)
        parts = [[piece.points for piece in source.pieces(route)] for route in source.routes]
        lines_of[place.map] = [shapely.LineString(np.concatenate(part)) for part in parts]
    for number, table in recordings.items():
        lines = lines_of[place_of(number).map]
        driving = table[table["class"] != "pedestrian"]
        points = shapely.points(driving[["xCenter", "yCenter"]].to_numpy())
        away = pd.DataFrame({index: shapely.distance(line, points) for index, line in enumerate(lines)})
        deviation = away.groupby(driving.trackId.to_numpy()).max().min(axis=1)
        swerving = deviation.index[deviation > LATERAL_TOLERANCE]
        assert len(swerving) <= SWERVING_TRACKS, number
        assert deviation.max() < sumo_tracks.SWERVE + LATERAL_TOLERANCE, number


def test_velocities_are_the_change_of_positions(recordings: dict[int, pd.DataFrame]) -> None:
    for table in recordings.values():
        step = table.groupby("trackId")[["xCenter", "yCenter", "frame"]].diff()
        speed = np.hypot(step.xCenter, step.yCenter) / (step.frame / sumo_tracks.FRAME_RATE)
        stated = pd.Series(np.hypot(table.xVelocity, table.yVelocity))
        mean = 0.5 * (stated + stated.groupby(table.trackId).shift())
        assert (speed - mean).abs().max() < 0.5
        assert np.abs(np.hypot(table.lonVelocity, table.latVelocity) - stated).max() < 0.01


def test_no_two_vehicles_overlap(recordings: dict[int, pd.DataFrame]) -> None:
    for number, table in recordings.items():
        vehicles = table[table["class"].isin(["car", "truck_bus"])]
        # A tree over all frames at once: frames are set apart by shifting each one far to the side.
        bodies = _bodies(vehicles, 1000.0 * vehicles.frame.to_numpy())
        first, second = shapely.STRtree(bodies).query(bodies, predicate="intersects")
        assert (first == second).all(), number


def _bodies(vehicles: pd.DataFrame, shift: NDArray[np.float64]) -> Any:
    heading = np.radians(vehicles.heading.to_numpy())
    along = 0.5 * vehicles.length.to_numpy()[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    aside = 0.5 * vehicles.width.to_numpy()[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    centre = np.stack([vehicles.xCenter + shift, vehicles.yCenter], axis=1)
    corners = [centre + along + aside, centre + along - aside, centre - along - aside, centre - along + aside]
    return shapely.polygons(np.stack(corners, axis=1))


def test_waiting_vehicles_stand_just_before_the_stop_line(recordings: dict[int, pd.DataFrame]) -> None:
    source = MapSource.read(BENDPLATZ.source)
    lines = [shapely.LineString(source.stop_lines[lane]) for lane in ("NE_in", "SW_in")]
    gaps = []
    for number in BENDPLATZ.recordings:
        table = recordings[number]
        cars = table[(table["class"] == "car") & (table.lonVelocity.abs() < 0.01)]
        heading = np.radians(cars.heading.to_numpy())
        front = cars[["xCenter", "yCenter"]].to_numpy()
        front = front + 0.5 * cars.length.to_numpy()[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        gap = np.min([shapely.distance(line, shapely.points(front)) for line in lines], axis=0)
        gaps.append(gap[gap < 3.0])
    every = np.concatenate(gaps)
    assert len(every) > 1000
    assert 0.3 < np.median(every) < 1.2
    assert (every < 1.5).mean() > 0.95


def test_drivers_take_turns_as_slowly_as_their_manner_wants() -> None:
    _, network = sumo_network.read()
    turns = [link for link in network.links.values() if link.direction in "lr" and link.speeds]
    assert len(turns) == 8
    for link in turns:
        in_order = [link.speeds[one] for one in sorted(CORNERING, key=CORNERING.__getitem__)]
        assert in_order == sorted(in_order)
        assert in_order[-1] / in_order[0] == pytest.approx(np.sqrt(4.0 / 1.4), rel=1e-3)


def test_recorded_turns_are_slow_and_not_all_alike() -> None:
    scenes = Scenes.load("bendplatz")
    found = slowest_in_junction(scenes)
    assert found["right"] is not None
    assert found["straight"] is not None
    assert 2.5 < found["right"].median < 5.5
    assert found["right"].high > 1.5 * found["right"].low
    assert found["straight"].median > 2.0 * found["right"].median
