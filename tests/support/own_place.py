"""A place of one's own: a map that does not ship, and small recordings there."""

from __future__ import annotations

import json
from pathlib import Path

from data.build import build
from intersection_env import Intersection, Scenes
from intersection_env.maps.intersection import MAPS
from tests.support.recordings import on_route, steady, write_recording

LOCATION = 77
FOES = {"before": 110.0, "after": 55.0}
"""Where a foe at about 8 m/s starts that reaches the junction before the yielder does, or after it [m]."""


def own_map(folder: Path, name: str = "mine") -> Path:
    """A map source like the T-junction's, under another name and for another location."""
    source = json.loads((MAPS / "t_junction.json").read_text(encoding="utf-8"))
    path = folder / f"{name}.json"
    path.write_text(json.dumps({**source, "name": name, "locations": [LOCATION]}), encoding="utf-8")
    return path


def own_recordings(folder: Path, map: Path, *ids: str) -> Path:
    """Recordings of 16 s, in each of which a car turns left before one foe, or after one and before another."""
    intersection = Intersection.load(map)
    for number, id in enumerate(ids):
        line = intersection.routes[intersection.route_index("S-W")].stop_line
        foes = list(FOES.values())[number % 2 :]
        movers = [
            on_route(intersection, "S-W", 1, 0.0, steady(line - 30.0 - number, 4.0 + 0.03 * number), 16.0),
            *(
                on_route(intersection, "W-E", 2 + k, 0.0, steady(at, 8.0 + 0.02 * (number + k)), 16.0)
                for k, at in enumerate(foes)
            ),
        ]
        write_recording(folder, id, movers, LOCATION)
    return folder


def own_scenes(folder: Path, *ids: str) -> tuple[Path, Path]:
    """A scenes file of recordings at a place of one's own, by default one for each split; and its map's file."""
    map = own_map(folder)
    recordings = own_recordings(folder / "recordings", map, *(ids or ("00", "01", "02")))
    build(recordings, Intersection.load(map), progress=False).save(folder / "mine.npz")
    return folder / "mine.npz", map


def load_own(folder: Path) -> Scenes:
    """The scenes of `own_scenes`."""
    return Scenes.load(folder / "mine.npz", folder / "mine.json")
