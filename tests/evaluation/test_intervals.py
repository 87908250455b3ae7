"""Intervals hold what they should, and depend on how recordings differ."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env.evaluation import intervals
from intersection_env.evaluation.intervals import interval


def mean(samples: np.ndarray) -> float:
    return float(samples.mean())


def test_equal_recordings_leave_no_doubt() -> None:
    found = interval({"01": np.array([1.0, 3.0]), "02": np.array([3.0, 1.0])}, mean)
    assert found == {"value": 2.0, "low": 2.0, "high": 2.0}


def test_interval_of_a_mean_is_as_wide_as_the_theory_says() -> None:
    """Recordings of one sample each: the interval is 1.96 standard errors to each side."""
    drawn = np.random.default_rng(0).normal(5.0, 2.0, 100)
    found = interval({str(k): drawn[k : k + 1] for k in range(100)}, mean)
    error = drawn.std() / 10.0
    assert found["value"] == pytest.approx(drawn.mean())
    assert found["low"] == pytest.approx(drawn.mean() - 1.96 * error, abs=0.1 * error)
    assert found["high"] == pytest.approx(drawn.mean() + 1.96 * error, abs=0.1 * error)


def test_samples_of_one_recording_stay_together() -> None:
    """A hundred copies of a recording's one sample tell no more than that sample."""
    few = {str(k): np.array([float(k)]) for k in range(6)}
    many = {name: np.repeat(samples, 100) for name, samples in few.items()}
    assert interval(many, mean) == pytest.approx(interval(few, mean))


def test_rows_compare_models_on_the_same_samples() -> None:
    rows = {str(k): np.array([[k + 1.0, k], [k + 2.0, k + 1.0]]) for k in range(4)}
    found = interval(rows, lambda samples: float((samples[:, 0] - samples[:, 1]).mean()))
    assert found == {"value": 1.0, "low": 1.0, "high": 1.0}


def test_nothing_to_measure_is_refused() -> None:
    with pytest.raises(ValueError, match="no samples"):
        interval({"01": np.zeros(0)}, mean)


def test_resamples_drawn_alike_count_as_often_as_they_are_drawn() -> None:
    """Of three recordings there are ten resamples, so each figure is taken ten times and once as they are."""
    parts = [np.array([1.0, 2.0]), np.array([4.0]), np.array([9.0, 8.0, 5.0])]
    asked = []

    def counted(samples: np.ndarray) -> float:
        asked.append(len(samples))
        return mean(samples)

    found = interval({str(k): part for k, part in enumerate(parts)}, counted)
    assert len(asked) == 10 + 1
    generator = np.random.default_rng(intervals.SEED)
    drawn = [
        mean(np.concatenate([parts[k] for k in generator.integers(3, size=3)])) for _ in range(intervals.RESAMPLES)
    ]
    assert (found["low"], found["high"]) == pytest.approx(np.quantile(drawn, [0.025, 0.975]))
