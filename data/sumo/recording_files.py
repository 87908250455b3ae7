"""Writes tracks as inD writes its recordings, and the settings file beside them."""

from __future__ import annotations

import hashlib
import json
import lzma
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from data.sumo.tracks import FRAME_RATE, Floats, Track
from intersection_env.files import written_whole

SPEED_LIMIT = 50.0 / 3.6  # [m/s]
LATITUDE, LONGITUDE = 50.78, 6.07
PIXEL = 0.00814  # [m]
DECIMALS = 3  # ours: inD has five; millimetres compress to two thirds of the size
WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday")


def write_recording(folder: Path, number: int, location: int, tracks: list[Track], duration: float) -> None:
    """Write a recording's three files; the tracks in order of appearance, `duration` [s]."""
    tracks_table, meta = _tables(number, tracks)
    stem = folder / f"{number:02d}"
    content = tracks_table.to_csv(index=False, float_format=f"%.{DECIMALS}f", lineterminator="\n").encode()
    _write(stem.with_name(f"{stem.name}_tracks.csv.xz"), lzma.compress(content, preset=6))
    for name, table in (("tracksMeta", meta), ("recordingMeta", _recording_meta(number, location, tracks, duration))):
        text = table.to_csv(index=False, float_format="%.5f", lineterminator="\n")
        _write(stem.with_name(f"{stem.name}_{name}.csv"), text.encode())


def write_settings(folder: Path, made_with: dict[str, object]) -> None:
    """Write the settings file: what made the recordings, and the checksums of all that lie in the folder."""
    names = sorted(path.name for path in folder.glob("[0-9][0-9]_*.csv*"))
    settings = {
        "about": "Simulated traffic, not observed: accuracies on it are not comparable with those on inD.",
        "licence": "CC0-1.0",
        "sumo_version": version("eclipse-sumo"),
        **made_with,
        "sha256": {name: hashlib.sha256(uncompressed(folder / name)).hexdigest() for name in names},
    }
    _write(folder / "settings.json", f"{json.dumps(settings, indent=2)}\n".encode())


def _write(path: Path, content: bytes) -> None:
    with written_whole(path) as temporary:
        temporary.write_bytes(content)


def uncompressed(path: Path) -> bytes:
    """A recording file's bytes as they are before compression."""
    content = path.read_bytes()
    return lzma.decompress(content) if path.suffix == ".xz" else content


def _tables(number: int, tracks: list[Track]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """inD's tracks and tracksMeta."""
    rows, meta = [], []
    for track_id, one in enumerate(tracks):
        count, shown = len(one.position), one.kind in ("car", "truck_bus")
        size = {"width": one.width if shown else 0.0, "length": one.length if shown else 0.0}
        cos, sin = np.cos(one.heading), np.sin(one.heading)
        turn = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
        own_velocity = np.einsum("nij,nj->ni", turn, one.velocity)
        own_acceleration = np.einsum("nij,nj->ni", turn, one.acceleration)
        ids = {"recordingId": number, "trackId": track_id}
        values = {
            "frame": one.first_frame + np.arange(count),
            "trackLifetime": np.arange(count),
            **_pair("xCenter", "yCenter", one.position),
            "heading": np.degrees(one.heading).round(DECIMALS) % 360.0,
            **size,
            **_pair("xVelocity", "yVelocity", one.velocity),
            **_pair("xAcceleration", "yAcceleration", one.acceleration),
            **_pair("lonVelocity", "latVelocity", own_velocity),
            **_pair("lonAcceleration", "latAcceleration", own_acceleration),
        }
        rows.append(pd.DataFrame({**ids, **values}))
        last = one.first_frame + count - 1
        span = {"initialFrame": one.first_frame, "finalFrame": last, "numFrames": count}
        meta.append({**ids, **span, **size, "class": one.kind})
    # Adding zero turns the -0.0 that rounding leaves into 0.0, which prints without a sign.
    table = pd.concat(rows, ignore_index=True)
    floats = table.select_dtypes("float").columns
    table[floats] = table[floats].round(DECIMALS) + 0.0
    return table, pd.DataFrame(meta)


def _pair(x: str, y: str, values: Floats) -> dict[str, Floats]:
    return {x: values[:, 0], y: values[:, 1]}


def _recording_meta(number: int, location: int, tracks: list[Track], duration: float) -> pd.DataFrame:
    vehicles = sum(one.kind in ("car", "truck_bus") for one in tracks)
    row = {
        "recordingId": number,
        "locationId": location,
        "frameRate": int(FRAME_RATE),
        "speedLimit": SPEED_LIMIT,
        "weekday": WEEKDAYS[number % len(WEEKDAYS)],
        "startTime": 8 + number % 10,
        "duration": duration,
        "numTracks": len(tracks),
        "numVehicles": vehicles,
        "numVRUs": len(tracks) - vehicles,
        "latLocation": LATITUDE,
        "lonLocation": LONGITUDE,
        "xUtmOrigin": 0.0,
        "yUtmOrigin": 0.0,
        "orthoPxToMeter": PIXEL,
    }
    return pd.DataFrame([row])
