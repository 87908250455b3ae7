"""Recorded scenes as the page plays them, and the moment with which it opens."""

from __future__ import annotations

from typing import Any

import numpy as np

from intersection_env.constants import DT, STEPS
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes
from intersection_env.viewer.road import rounded

LOOKED_AT = round(1.0 / DT)  # [step], ours: between moments that are looked at for the busiest: one a second


def scene_of(scene: Scene) -> dict[str, Any]:
    """A scene's tracks: from which step on, and along which route, each drives where and how fast."""
    return {
        "id": scene.id,
        "steps": scene.steps,
        "split": scene.split,
        "tracks": [_track(track) for track in scene.tracks],
    }


def label(vehicle_id: str) -> str:
    """A vehicle's id without its recording, which all vehicles of a scene share: "07/15" becomes "15"."""
    return vehicle_id.rpartition("/")[2]


def scene_called(scenes: Scenes, scene_id: str) -> Scene:
    """The scene of that id.

    Raises:
        ValueError: there is none.
    """
    try:
        return scenes[scene_id]
    except KeyError as error:
        raise ValueError(error.args[0]) from None


def step_of(scene: Scene, time: float) -> int:
    """The step of a scene at a time since its begin [s].

    Raises:
        ValueError: the time is not a multiple of 0.2 s within the scene.
    """
    step = round(time / DT) if np.isfinite(time) else -1
    if not 0 <= step < scene.steps or abs(step * DT - time) > 1e-6:
        raise ValueError(
            f"the moment is {time:g} s; scene {scene.id} has states every {DT:g} s from 0 to {scene.duration:.1f} s"
        )
    return step


def busiest_scene(scenes: Scenes) -> Scene:
    """The scene in which most vehicles are there at once, of those that last for a prediction if any does.

    Raises:
        ValueError: there is no scene.
    """
    if not len(scenes):
        raise ValueError(f"no scenes on {scenes.intersection.name}: nothing to show")
    return max(scenes, key=lambda scene: (scene.steps > STEPS, int(_present(scene).max(initial=0))))


def busiest_step(scenes: Scenes, scene: Scene) -> int:
    """The step with the most open conflicts that leaves time for a prediction; the first, if there are several."""
    last = max(0, scene.steps - 1 - STEPS)
    steps = range(0, last + 1, LOOKED_AT)
    present = _present(scene)
    crowded = sorted(steps, key=lambda step: -present[step])[:60]  # ours: conflicts need vehicles; a minute at most
    return max(sorted(crowded), key=lambda step: len(scenes.at(scene, step * DT).conflicts))


def _present(scene: Scene) -> Any:
    """How many vehicles are there at each step: (step,)."""
    change = np.zeros(scene.steps + 1, np.int64)
    for track in scene.tracks:
        change[track.start] += 1
        change[track.stop] -= 1
    return np.cumsum(change[:-1])


def _track(track: Track) -> dict[str, Any]:
    return {
        "id": track.id,
        "label": label(track.id),
        "roadUser": track.road_user,
        "route": track.route,
        "length": round(track.length, 2),
        "width": round(track.width, 2),
        "start": track.start,
        "position": rounded(track.position),
        "speed": rounded(track.speed),
        "observedFrom": int(np.argmax(track.observed)) if track.observed.any() else len(track.observed),
    }
