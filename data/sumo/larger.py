"""The places so many times as large, to learn from: streets elsewhere have wider junctions and gentler turns."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from data.source_text import source_text
from data.sumo.places import Place
from intersection_env.files import written_whole

VIEW = 10.0  # [m], ours: a camera from which a place so many times as large is seen sees so much further, for each time


def larger(place: Place, times: float, folder: Path) -> Place:
    """The place so many times as large; its map source is written into the folder unless it is there.

    All is drawn larger but the lanes' widths: ways through the junction, their radii, and how far arms reach. Drivers
    and traffic are the same.

    Raises:
        OSError: a file cannot be read or written.
    """
    percent = round(100 * times)
    name, location = f"{place.map}_{percent}", 1000 * place.location + percent
    path = folder / f"{name}.json"
    if not path.exists():
        content = json.loads(place.source.read_text(encoding="utf-8"))
        content |= {"name": name, "locations": [location], "about": f"{place.map}, {times:g} times as large."}
        with written_whole(path) as temporary:
            temporary.write_text(source_text(_scaled(content, times)), encoding="utf-8")
    view = {right: far + VIEW * (times - 1.0) for right, far in place.view.items()}
    return replace(place, map=name, location=location, view=view, folder=folder)


def _scaled(content: dict[str, Any], times: float) -> dict[str, Any]:
    def points(some: list[list[float]]) -> list[list[float]]:
        rows: list[list[float]] = np.round(times * np.array(some), 3).tolist()
        return rows

    lanes = {name: lane | {"points": points(lane["points"])} for name, lane in content["lanes"].items()}
    lines = {name: points(line) for name, line in content.get("stop_lines", {}).items()}
    routes = {
        id: route | {"inside": points(route["inside"])} if _is_drawn(route) else route
        for id, route in content["routes"].items()
    }
    return content | {"lanes": lanes, "stop_lines": lines, "routes": routes}


def _is_drawn(route: dict[str, Any]) -> bool:
    """Whether its way inside the junction is points, not lanes."""
    return "inside" in route and not isinstance(route["inside"][0], str)
