"""The gap network's samples: features as of the twin, labels as of the recording."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agents.gap.samples import UNKNOWN, GapSamples, gap_samples
from data.build import build
from intersection_env import Intersection, Scenes
from intersection_env.features import Gap
from tests.reference import predictor as reference
from tests.support.gap_samples import gap_samples_of
from tests.support.paths import RECORDINGS
from tests.support.twins import twin_map


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return build(RECORDINGS, Intersection.load("bendplatz"), ["12"], progress=False)


@pytest.fixture(scope="module")
def samples(scenes: Scenes) -> GapSamples:
    return gap_samples(scenes, progress=False)[0]


def twin_traffic(scenes: Scenes, frame: str) -> tuple[reference.Traffic, tuple[str, ...], str]:
    scene, seconds, yielder = frame.split(" ")
    traffic = scenes.at(scene, float(seconds))
    floats = (
        getattr(traffic, name).astype(np.float64) for name in ("position", "speed", "length", "width", "max_speed")
    )
    return reference.Traffic(traffic.route.astype(np.int64), *floats), traffic.ids, yielder


def test_features_equal_the_twin(scenes: Scenes, samples: GapSamples) -> None:
    for number in np.random.default_rng(0).choice(len(samples), 60, replace=False):
        twin, ids, yielder = twin_traffic(scenes, str(samples.frame[number]))
        pairs = reference.conflicts(twin_map("bendplatz"), twin)
        truth = reference.observe(twin_map("bendplatz"), twin).gap[pairs[:, 0] == ids.index(yielder)]
        np.testing.assert_allclose(samples.features[samples.sample == number], truth, atol=2e-3)


def test_labels_say_who_reached_the_conflict_first(scenes: Scenes, samples: GapSamples) -> None:
    """By brute force: walk on from the frame until one of the two has its front in the conflict."""
    map_ = twin_map("bendplatz")
    for number in np.random.default_rng(1).choice(len(samples), 40, replace=False):
        twin, ids, yielder = twin_traffic(scenes, str(samples.frame[number]))
        scene_id = str(samples.frame[number]).split(" ")[0]
        scene = scenes[scene_id]
        own = ids.index(yielder)
        expected = []
        for i, j in reference.conflicts(map_, twin).tolist():
            if i != own:
                continue
            conflict = reference.conflict_of(map_, twin, i, j)
            assert conflict is not None
            fronts = {}
            for vehicle, begin in ((i, conflict.begin_yielder), (j, conflict.begin_prioritized)):
                track = scene.track(ids[vehicle])
                inside = [k for k, s in enumerate(track.position) if s + track.length / 2 >= begin]
                fronts[vehicle] = track.start + inside[0] if inside else None
            mine, other = fronts[i], fronts[j]
            if mine is not None and (other is None or mine < other):
                expected.append(1)
            else:
                expected.append(0 if other is not None else UNKNOWN)
        assert samples.first[samples.sample == number].tolist() == expected


def test_a_sample_with_one_refused_pair_is_refused_whatever_the_others() -> None:
    first = [1, 0, 1, UNKNOWN, 1, 1]
    made = gap_samples_of(np.zeros((6, len(Gap))), first, [0, 0, 1, 1, 2, 2])
    chosen = made.select("all")
    assert chosen.labels().tolist() == [False, True]
    assert chosen.frame.tolist() == made.frame[[0, 2]].tolist(), "an open pair among accepted ones leaves it unknown"
    only_far = dataclasses.replace(made, recorded=np.array([1, 0, 1, 0, 0, 0], bool)).select("recorded")
    assert only_far.labels().tolist() == [True, True]
    assert only_far.frame.tolist() == made.frame[[0, 1]].tolist()
