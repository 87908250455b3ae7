"""What a yielding driver sees, and what that driver then did: the samples of the gap network.

One sample is a frame (5 Hz) and a recorded car or truck that must yield, is not yet past its point of guaranteed
arrival and is not slowed by a lead vehicle. It has one row per active pair; features come from the core.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from intersection_env.constants import DT
from intersection_env.features import Driving, Gap
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.meeting import Conflict
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import each_place
from intersection_env.scenes.scene import Scene, Track
from intersection_env.scenes.scenes import Scenes

LED_DISTANCE = 10.0  # [m], ours: a lead this near slows a driver down whatever the speed
LED_TIME = 2.0  # [s], ours: or one this near in time
UNKNOWN = -1

Foes = Literal["recorded", "all"]
"""Which prioritized vehicles count: those in the field of view, or also those extrapolated into the past."""


class Kinematics(IntEnum):
    """Columns of `GapSamples.kinematics`."""

    DISTANCE_TO_STOP_LINE = 0
    V_MAX = 1
    FOE_V_MAX = 2
    FOE_TO_LEAVE = 3
    MERGING = 4
    FOE_LENGTH = 5


@dataclass(frozen=True)
class GapSamples:
    """Pairs in rows, grouped by sample.

    features: (pair, 4) float32, columns `Gap`, as of `Observation.gap`: distance to the PGA [m], speed [m/s], the
        foe's distance to its stop line [m], its speed [m/s].
    kinematics: (pair, 6) float32, columns `Kinematics`: the yielder's distance to its stop line [m] and v_max [m/s];
        the foe's v_max [m/s] and its distance until its rear has left the conflict [m]; merging (0 or 1); the foe's
        length [m].
    first: (pair,) int8, 1 if the yielder reached the conflict first, 0 if the foe did, -1 if the scene ends before.
    recorded: (pair,) bool, the foe was in the field of view at that frame.
    critical_gap, sumo: (pair,) bool, what the rules of the core decide.
    sample: (pair,) int64, ascending; sample_recording: (sample,) str; frame: (sample,) str, scene, time and yielder.
    """

    features: NDArray[np.float32]
    kinematics: NDArray[np.float32]
    first: NDArray[np.int8]
    recorded: NDArray[np.bool_]
    critical_gap: NDArray[np.bool_]
    sumo: NDArray[np.bool_]
    sample: NDArray[np.int64]
    sample_recording: NDArray[np.str_]
    frame: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.sample_recording)

    def select(self, foes: Foes) -> GapSamples:
        """The samples with a known label, and their pairs, when only these foes count."""
        pairs = self.recorded if foes == "recorded" else np.ones(len(self.sample), np.bool_)
        refused = self._any(pairs & (self.first == 0))
        known = refused | (self._any(pairs) & ~self._any(pairs & (self.first == UNKNOWN)))
        return self._keep(known, pairs)

    def of(self, recordings: Iterable[str]) -> GapSamples:
        """The samples of some recordings."""
        return self._keep(np.isin(self.sample_recording, list(recordings)), np.ones(len(self.sample), np.bool_))

    def of_split(self, scenes: Scenes | Sequence[Scenes], split: str) -> GapSamples:
        """The samples of a split's recordings."""
        return self.of({scene.recording for place in each_place(scenes) for scene in place if scene.split == split})

    def labels(self) -> NDArray[np.bool_]:
        """(sample,) whether the yielder entered before all its foes; call `select` first."""
        return ~self._any(self.first == 0)

    def decide(self, accepts: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(sample,) the minimum over the pairs of a decision (pair,)."""
        return ~self._any(~accepts)

    def least(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """(sample,) the smallest of the values (pair,) of each sample."""
        result = np.full(len(self), np.inf)
        np.minimum.at(result, self.sample, values.astype(np.float64))
        return result

    def padded(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """features (sample, foe, 4) and which of them are there (sample, foe)."""
        counts = np.bincount(self.sample, minlength=len(self))
        place = np.arange(len(self.sample)) - np.repeat(np.cumsum(counts) - counts, counts)
        there = np.zeros((len(self), int(counts.max(initial=1))), np.bool_)
        features = np.zeros((*there.shape, len(Gap)), np.float32)
        there[self.sample, place] = True
        features[self.sample, place] = self.features
        return features, there

    def _any(self, flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return np.bincount(self.sample[flags], minlength=len(self)) > 0

    def _keep(self, samples: NDArray[np.bool_], pairs: NDArray[np.bool_]) -> GapSamples:
        pairs = pairs & samples[self.sample]
        number = np.cumsum(samples) - 1
        kept = {
            field.name: getattr(self, field.name)[samples if field.name in ("sample_recording", "frame") else pairs]
            for field in fields(self)
        }
        return replace(self, **kept | {"sample": number[self.sample[pairs]]})


def gap_samples(scenes: Scenes | Sequence[Scenes], progress: bool = True) -> tuple[GapSamples, dict[str, int]]:
    """The samples of all scenes, of one place or several, and how many yielders at a frame were left out, by reason.

    Raises:
        ValueError: there is no sample.
    """
    rules = {gap: Predictor.load("idm", gap=gap) for gap in ("critical_gap", "sumo")}
    rows: dict[str, list[NDArray[np.generic]]] = {field.name: [] for field in fields(GapSamples)}
    left_out: Counter[str] = Counter()
    count = 0
    every = [(place, scene) for place in each_place(scenes) for scene in place]
    for place, scene in tqdm(every, desc="gap samples", unit="scene", disable=None if progress else True):
        orders = _Orders(place.intersection)
        for step in range(scene.steps):
            count += _frame(place, scene, step, rules, orders, rows, count, left_out)
    if not count:
        raise ValueError("the scenes hold no yielding vehicle with a foe: nothing to learn gaps from")
    return GapSamples(**{name: np.concatenate(values) for name, values in rows.items()}), dict(left_out)


def _frame(
    scenes: Scenes,
    scene: Scene,
    step: int,
    rules: dict[str, Predictor],
    orders: _Orders,
    rows: dict[str, list[NDArray[np.generic]]],
    first_sample: int,
    left_out: Counter[str],
) -> int:
    """Adds the samples of one frame; returns how many."""
    traffic = scenes.at(scene, step * DT)
    if not len(traffic.conflicts):
        return 0
    tracks = [scene.track(id) for id in traffic.ids]
    observed = np.array([track.observed[step - track.start] for track in tracks])
    seen = rules["sumo"].observe(traffic)
    reasons = np.array(
        [_why_not(track, bool(o), row) for track, o, row in zip(tracks, observed, seen.driving, strict=True)]
    )
    yielders = np.unique(traffic.conflicts[:, 0])
    left_out.update(reason for reason in reasons[yielders].tolist() if reason)
    chosen = yielders[reasons[yielders] == ""]
    kept = np.isin(traffic.conflicts[:, 0], chosen)
    if not kept.any():
        return 0
    i, j = traffic.conflicts[kept].T
    to_stop_line, v_max = seen.driving[:, Driving.DISTANCE_TO_STOP_LINE], seen.driving[:, Driving.V_MAX]
    conflicts = [orders.conflict(tracks[a], tracks[b]) for a, b in zip(i, j, strict=True)]
    leaves = (
        np.array([c.on_prioritized[1] for c in conflicts], np.float32) - traffic.position[j] + 0.5 * traffic.length[j]
    )
    kinematics = {
        Kinematics.DISTANCE_TO_STOP_LINE: to_stop_line[i],
        Kinematics.V_MAX: v_max[i],
        Kinematics.FOE_V_MAX: v_max[j],
        Kinematics.FOE_TO_LEAVE: leaves,
        Kinematics.MERGING: np.array([c.merging for c in conflicts], np.float32),
        Kinematics.FOE_LENGTH: traffic.length[j],
    }
    rows["features"].append(seen.gap[kept])
    rows["kinematics"].append(np.stack([kinematics[column] for column in Kinematics], axis=1))
    rows["first"].append(np.array([orders.first(tracks[a], tracks[b]) for a, b in zip(i, j, strict=True)], np.int8))
    rows["recorded"].append(observed[j])
    rows["critical_gap"].append(rules["critical_gap"].observe(traffic).accepts[kept])
    rows["sumo"].append(seen.accepts[kept])
    rows["sample"].append(first_sample + np.searchsorted(chosen, i))
    rows["sample_recording"].append(np.array([scene.recording] * len(chosen)))
    rows["frame"].append(np.array([f"{scene.id} {step * DT:.1f} {traffic.ids[a]}" for a in chosen]))
    return len(chosen)


def _why_not(track: Track, observed: bool, driving: NDArray[np.float32]) -> str:
    """Why a yielder at a frame makes no sample; empty if it does."""
    if track.road_user == "bicycle":
        return "bicycle"
    if not observed:
        return "extrapolated"
    if driving[Driving.LEAD_DISTANCE] < max(LED_DISTANCE, LED_TIME * float(driving[Driving.SPEED])):
        return "slowed by a lead"
    return ""


class _Orders:
    """Who reached which conflict first in one scene, remembered by pair of tracks."""

    def __init__(self, intersection: Intersection) -> None:
        self._between = {(c.yielder, c.prioritized): c for c in intersection.conflicts}
        self._first: dict[tuple[str, str], int] = {}

    def conflict(self, yielder: Track, foe: Track) -> Conflict:
        return self._between[yielder.route, foe.route]

    def first(self, yielder: Track, foe: Track) -> int:
        """1 the yielder, 0 the foe, -1 if neither reached the conflict before the scene's end."""
        key = yielder.id, foe.id
        if key not in self._first:
            conflict = self.conflict(yielder, foe)
            mine = _reaches(yielder, conflict.on_yielder[0])
            other = _reaches(foe, conflict.on_prioritized[0])
            self._first[key] = 1 if mine < other else 0 if np.isfinite(other) else UNKNOWN
        return self._first[key]


def _reaches(track: Track, line: float) -> float:
    """When the front first is at an arc length, in steps of the scene; infinite if it never is."""
    reached = np.flatnonzero(track.position + 0.5 * track.length >= line)
    return float(track.start + reached[0]) if len(reached) else np.inf
