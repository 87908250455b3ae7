"""Writes a map source whose lanes were moved; everything else in the file stays as its author wrote it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from data.source_text import source_text
from intersection_env.files import written_whole
from intersection_env.maps.source import MapSource
from intersection_env.maps.source_entries import Lane


def write_source(original: Path, source: MapSource, path: Path, name: str, about: str) -> None:
    """The file `original` with the lanes and ways that are others in `source`, at `path`, under a name of its own.

    Raises:
        OSError: a file cannot be read or written.
    """
    content = json.loads(original.read_text(encoding="utf-8"))
    content |= {"name": name, "about": " ".join(filter(None, (content.get("about"), about)))}
    before = MapSource.read(original)
    for name, lane in source.lanes.items():
        old = before.lanes[name]
        if not (np.array_equal(lane.points, old.points) and np.array_equal(lane.width, old.width)):
            content["lanes"][name] = _lane(lane)
    for old_route, route in zip(before.routes, source.routes, strict=True):
        if route.inside is None or old_route.inside is None or np.array_equal(route.inside, old_route.inside):
            continue
        content["routes"][route.id]["inside"] = route.inside.tolist()
    with written_whole(path) as temporary:
        temporary.write_text(source_text(content), encoding="utf-8")


def _lane(lane: Lane) -> dict[str, Any]:
    width = lane.width.tolist()
    return {"width": width[0] if len(set(width)) == 1 else width, "points": lane.points.tolist()}
