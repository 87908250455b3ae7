"""Gap samples written by hand, and a planted rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.gap.samples import GapSamples

PLANTED_GAP = 5.0  # [s]


def planted_samples(count: int, seed: int, recordings: int = 4) -> GapSamples:
    """Yielders with one to three foes each, who enter exactly if every foe is more than 5 s away."""
    generator = np.random.default_rng(seed)
    foes = generator.integers(1, 4, count)
    sample = np.repeat(np.arange(count), foes)
    pairs = len(sample)
    speed = generator.uniform(3.0, 15.0, pairs)
    seconds = generator.uniform(0.0, 12.0, pairs)
    own = generator.uniform([2.0, 0.0], [30.0, 10.0], (count, 2))[sample]
    features = np.column_stack([own, seconds * speed, speed]).astype(np.float32)
    return hand_made(features, (seconds > PLANTED_GAP).astype(np.int8), sample, recordings)


def hand_made(
    features: NDArray[np.float32], first: NDArray[np.int8], sample: NDArray[np.int64], recordings: int = 1
) -> GapSamples:
    """Samples with these pairs; all foes recorded, rules that never accept."""
    count = int(sample.max()) + 1
    return GapSamples(
        features=features,
        kinematics=np.zeros((len(sample), 6), np.float32),
        first=first,
        recorded=np.ones(len(sample), np.bool_),
        critical_gap=np.zeros(len(sample), np.bool_),
        sumo=np.zeros(len(sample), np.bool_),
        sample=sample,
        sample_recording=np.array([f"{k % recordings:02d}" for k in range(count)]),
        frame=np.array([str(k) for k in range(count)]),
    )
