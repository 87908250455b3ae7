"""Small recordings written by hand, taken through the pipeline."""

from __future__ import annotations

from pathlib import Path

from data.formats.ind import read_recording
from data.pipeline.projection import Projection, project
from data.pipeline.scenes_of import build_scenes
from intersection_env.maps.intersection import Intersection
from intersection_env.scenes.scene import Scene
from tests.support.recordings import Mover, on_route, steady, write_recording


def projected(folder: Path, intersection: Intersection, movers: list[Mover]) -> Projection:
    """The tracks on their routes."""
    write_recording(folder, "07", movers)
    return project(read_recording(folder, "07").resampled(0.2), intersection)


def scenes_of(folder: Path, intersection: Intersection, movers: list[Mover]) -> tuple[list[Scene], dict[str, float]]:
    """The scenes, and what was dropped."""
    write_recording(folder, "07", movers)
    return build_scenes(read_recording(folder, "07"), "train", intersection)


def steady_traffic(intersection: Intersection, seconds: float, first: int = 10) -> list[Mover]:
    """A vehicle each way every 8 s, 8 m/s, seen from 110 m to 190 m."""
    return [
        on_route(intersection, route, first + 2 * k + side, 8.0 * k, steady(110.0, 8.0), 10.0)
        for k in range(int(seconds / 8.0))
        for side, route in enumerate(("NW-SE", "SE-NW"))
    ]
