"""Junctions of our own imported by the command, and files that it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from data.maps.__main__ import main
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.source import MapSource
from tests.support.lane_maps import (
    Junction,
    origin,
    write_commonroad_map,
    write_lanelet2_map,
)


def imported(tmp_path: Path, drawn: Junction, *options: str, suffix: str = ".xml") -> MapSource:
    path, out = tmp_path / f"map{suffix}", tmp_path / "out.json"
    if suffix == ".osm":
        write_lanelet2_map(path, drawn)
        options = ("--origin", "{},{}".format(*origin()), *options)
    else:
        write_commonroad_map(path, drawn)
    assert main([str(path), "--out", str(out), *options]) == 0
    Intersection.load(out)
    return MapSource.read(out)


def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], path: Path, *options: str) -> str:
    """The message; nothing is written."""
    assert main([str(path), "--out", str(tmp_path / "out.json"), *options]) == 1
    assert [one.name for one in tmp_path.iterdir() if one.suffix == ".json"] == []
    return capsys.readouterr().err
