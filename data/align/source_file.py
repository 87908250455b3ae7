"""Writes a map source whose lanes were moved; everything else in the file stays as its author wrote it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from data.maps.source_text import source_text
from intersection_env.files import written_whole
from intersection_env.maps.source import Lane, MapSource


def write_source(original: Path, source: MapSource, path: Path, name: str, about: str) -> None:
    """The file `original` with the lanes and ways of `source`, to the centimetre, at `path`, under a name of its own.

    Raises:
        OSError: a file cannot be read or written.
    """
    content = json.loads(original.read_text(encoding="utf-8"))
    content |= {"name": name, "about": " ".join(filter(None, (content.get("about"), about)))}
    content["lanes"] = {name: _lane(lane) for name, lane in source.lanes.items()}
    for route in source.routes:
        if route.inside is not None:
            content["routes"][route.id]["inside"] = (np.round(route.inside, 2) + 0.0).tolist()
    with written_whole(path) as temporary:
        temporary.write_text(source_text(content), encoding="utf-8")


def _lane(lane: Lane) -> dict[str, Any]:
    points = (np.round(lane.points, 2) + 0.0).tolist()
    width = np.round(lane.width, 2).tolist()
    return {"width": width[0] if len(set(width)) == 1 else width, "points": points}
