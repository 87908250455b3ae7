"""Gap samples written by hand, and with a planted rule."""

from __future__ import annotations

import numpy as np

from agents.gap.samples import GapSamples, Kinematics
from intersection_env.features import Gap

CAR = 4.5  # [m]
PLANTED_GAP = 5.0  # [s]


def gap_samples_of(
    features: object, first: object, sample: object | None = None, kinematics: object | None = None
) -> GapSamples:
    """Samples of one recording, "00"; by default one pair each, with every foe recorded and what is beside typical."""
    rows = np.array(features, np.float32).reshape(-1, len(Gap))
    number = np.arange(len(rows)) if sample is None else np.array(sample, np.int64)
    count = int(number.max()) + 1
    beside = np.tile(np.array([5.0, 10.0, 14.0, 50.0, 0.0, CAR], np.float32), (len(rows), 1))
    return GapSamples(
        features=rows,
        kinematics=beside if kinematics is None else np.array(kinematics, np.float32).reshape(-1, len(Kinematics)),
        first=np.array(first, np.int8),
        recorded=np.ones(len(rows), np.bool_),
        critical_gap=np.zeros(len(rows), np.bool_),
        sumo=np.ones(len(rows), np.bool_),
        sample=number,
        sample_recording=np.array(["00"] * count),
        frame=np.array([f"00/0 {k}" for k in range(count)]),
    )


def planted(count: int, seed: int = 0, foe_speed: tuple[float, float] = (10.0, 10.0)) -> GapSamples:
    """Yielders with one foe or more at speeds in this range [m/s], who go first where every foe is 5 s away."""
    generator = np.random.default_rng(seed)
    sample = np.sort(np.concatenate([np.arange(count), generator.integers(0, count, count)]))
    seconds = generator.uniform(0.0, 2.0 * PLANTED_GAP, len(sample))
    features = np.zeros((len(sample), len(Gap)))
    features[:, Gap.DISTANCE_TO_PGA] = 12.0
    features[:, Gap.SPEED] = 3.0
    features[:, Gap.FOE_SPEED] = generator.uniform(*foe_speed, len(sample))
    features[:, Gap.FOE_DISTANCE_TO_STOP_LINE] = seconds * features[:, Gap.FOE_SPEED]
    return gap_samples_of(features, seconds > PLANTED_GAP, sample)
