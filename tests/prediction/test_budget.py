"""What a planner's cycle may spend on crossing orders, and what a ranking says and shows."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from intersection_env import Intersection, Predictor, Traffic, _core, forecast, rank_maneuvers
from tests.support.busy_traffic import busy
from tests.support.random_traffic import random_traffic
from tests.support.twins import as_traffic, rounded, twin_map


def crowd(vehicles: int = 30, seed: int = 0) -> Traffic:
    """So many vehicles near the junction, with millions of orders."""
    twin = random_traffic(twin_map("bendplatz"), np.random.default_rng(seed), vehicles)
    return as_traffic(Intersection.load("bendplatz"), rounded(twin))


@pytest.mark.parametrize("by", ["expectation", "prediction"])
def test_by_default_a_ranking_predicts_what_a_cycle_has_time_for(by: str) -> None:
    predictor, traffic = Predictor.load(), crowd()
    table = rank_maneuvers(predictor, traffic, by=by)  # type: ignore[arg-type]
    assert table.intervention.sum() == _core.orders_in_a_cycle(30) == 2666
    assert table.attrs["left_out"] == 20_000, "counted so far"
    whole = rank_maneuvers(predictor, busy())
    assert whole.attrs["left_out"] == 0


def test_a_cycle_has_time_for_fewer_orders_of_more_vehicles() -> None:
    counts = [_core.orders_in_a_cycle(vehicles) for vehicles in range(65)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == counts[15] == 10_000
    assert counts[64] > 500


@pytest.mark.parametrize("by", ["expectation", "prediction"])
def test_a_ranking_ends_in_time_and_says_what_it_left_out(by: str) -> None:
    predictor, traffic = Predictor.load(), crowd()
    table = rank_maneuvers(predictor, traffic, limit=None, seconds=1e-6, by=by)  # type: ignore[arg-type]
    assert 256 <= table.intervention.sum() <= 1024, "a batch at least"
    assert table.attrs["left_out"] >= 1024
    unhurried = rank_maneuvers(predictor, busy(), seconds=1e3, by=by)  # type: ignore[arg-type]
    pd.testing.assert_frame_equal(unhurried, rank_maneuvers(predictor, busy(), by=by))  # type: ignore[arg-type]


def test_a_forecast_ends_in_time_and_says_what_it_left_out() -> None:
    predictor, traffic = Predictor.load(), crowd()
    found = forecast(predictor, traffic, limit=10**6, seconds=1e-6)
    assert found.feasible == found.left_out == 1024
    whole = forecast(predictor, busy())
    np.testing.assert_array_equal(forecast(predictor, busy(), seconds=1e3).orders, whole.orders)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan")])
def test_a_time_that_is_none_is_refused(seconds: float) -> None:
    for call in (rank_maneuvers, forecast):
        with pytest.raises(ValueError, match="seconds must be above 0, not"):
            call(Predictor.load(), busy(), seconds=seconds)


@pytest.mark.parametrize("policy", ["rollout_gradient", "idm"])
def test_a_printed_ranking_shows_gain_safe_and_distance(policy: str) -> None:
    """On a terminal of 80 columns, which shows the first and the last columns."""
    table = rank_maneuvers(Predictor.load(policy), busy())
    with pd.option_context("display.max_columns", 0, "display.width", 80):
        head = str(table).splitlines()[0].split()
    assert {"order", "gain", "minimum_distance", "safe"} <= set(head)


def test_no_threads_stands_for_the_cores_that_the_process_may_use(tmp_path: Path) -> None:
    code = "import intersection_env as i; print(i._core.usable_cores())"
    one = min(os.sched_getaffinity(0))
    narrow = f"import os; os.sched_setaffinity(0, {{{one}}}); {code}"
    done = subprocess.run([sys.executable, "-c", narrow], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"
    allowed = len(os.sched_getaffinity(0))
    for quota, cores in (("max 100000", allowed), ("50000 100000", 1), ("150000 100000", min(2, allowed))):
        (tmp_path / "cpu.max").write_text(f"{quota}\n")
        assert _core.usable_cores(str(tmp_path)) == cores
    (tmp_path / "cpu.max").unlink()
    (tmp_path / "cpu").mkdir()
    for quota, cores in (("-1", allowed), ("100000", 1)):
        (tmp_path / "cpu" / "cpu.cfs_quota_us").write_text(f"{quota}\n")
        (tmp_path / "cpu" / "cpu.cfs_period_us").write_text("100000\n")
        assert _core.usable_cores(str(tmp_path)) == cores
