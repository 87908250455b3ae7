"""Stretches of recorded scenes to replay, for the core and for its twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from data.build import build
from intersection_env import Intersection, _core
from tests.reference.worlds import Recording, Rules, Scene, Track
from tests.support.paths import RECORDINGS
from tests.support.replay_cases import can_act, replay, window
from tests.support.twins import twin_map
from tests.support.worlds_cases import rules_and_policy

MAP = "bendplatz"
STEPS = 110  # of a window; twenty seconds are two or three queues
DECISIONS = ("recording", "critical_gap", "sumo", "network")


@dataclass(frozen=True)
class Windows:
    """Stretches of recorded scenes, and which track of which scene a number means."""

    scenes: Sequence[Scene]
    where: Sequence[tuple[int, int]]

    def track(self, number: int) -> Track:
        scene, track = self.where[number]
        return self.scenes[scene].tracks[track]

    def able(self) -> list[int]:
        """Who can act."""
        return [number for number in range(len(self.where)) if can_act(self.track(number))]

    def recording(self, number: int, rules: Rules | None) -> tuple[Recording, int]:
        """The scene of a number as the twin takes it, and the number of its track there."""
        scene, track = self.where[number]
        return Recording(twin_map(MAP), self.scenes[scene], rules), track


@cache
def recorded_windows() -> Windows:
    """Three of recording 12."""
    scenes = build(RECORDINGS, Intersection.load(MAP), ["12"], progress=False)
    chosen = [window(scenes["12/0"], 60, STEPS), window(scenes["12/2"], 300, STEPS), window(scenes["12/3"], 90, STEPS)]
    return Windows(chosen, [(k, track) for k, scene in enumerate(chosen) for track in range(len(scene.tracks))])


def replayed_windows(worlds: int, **how: Any) -> _core.Replay:
    """The core's replay of them; how: as `replay_cases.replay`."""
    return replay(MAP, recorded_windows().scenes, worlds, **how)


def rules_of(decisions: str) -> Rules | None:
    """Whose gap decisions count for the twin; None: the recorded ones."""
    return None if decisions == "recording" else rules_and_policy(decisions)[0]
