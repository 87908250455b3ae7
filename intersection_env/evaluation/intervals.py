"""Intervals by resampling recordings: vehicles of one recording meet the same traffic, those of two do not."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

RESAMPLES, COVERAGE, SEED = 2000, 0.95, 0

Floats = NDArray[np.float64]


def interval(samples: Mapping[str, Floats], statistic: Callable[[Floats], float]) -> dict[str, float]:
    """A figure with its bootstrap interval over recordings.

    Args:
        samples: by recording, (sample, ...); to compare two models, put what both did into one row.
        statistic: of the samples of all recordings together.

    Returns:
        "value", of the recordings as they are; "low" and "high", which hold 95 % of the resamples.

    Raises:
        ValueError: no recording has a sample.
    """
    parts = [part for part in samples.values() if len(part)]
    if not parts:
        raise ValueError("no samples to take an interval of")
    generator = np.random.default_rng(SEED)
    resamples = np.sort([generator.integers(len(parts), size=len(parts)) for _ in range(RESAMPLES)], axis=1)
    kinds, which = np.unique(resamples, axis=0, return_inverse=True)  # of few recordings most are drawn again and again
    drawn = np.array([statistic(np.concatenate([parts[k] for k in row])) for row in kinds])[which.reshape(-1)]
    tail = 0.5 * (1.0 - COVERAGE)
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    return {"value": float(statistic(np.concatenate(parts))), "low": float(low), "high": float(high)}
