"""A forecast timed beside the ranking, from Python and from C++."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.bench import bench
from experiments.bench import forecast as forecast_bench
from experiments.bench.forecast import cpp_times, python_times, summary, times_text
from experiments.bench.timed_traffic import traffic, traffic_with_orders
from experiments.show.predictor_speed import forecast_sentences

SPREAD = {"median": 2.0, "most": 3.0, "best": 1.0}


def test_summary_is_worked_out_by_hand() -> None:
    row = summary(SPREAD, {"median": 40.0, "most": 50.0, "best": 30.0}, [1.0] * 98 + [3.0, 3.0])
    assert row["to_ranking"] == 0.05
    assert row["p99_to_median"] == pytest.approx(3.0)
    assert row["calls"] == 100
    assert "2.00 ms, 0.050 of the ranking's 40.0 ms (at most 0.15)" in times_text(row)


def test_part_alone_is_timed_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forecast_bench, "CALLS", 40)
    monkeypatch.setattr(forecast_bench, "cpp_times", lambda *_: {"missing": "cmake or ninja is not installed"})
    out = tmp_path / "bench.json"
    out.write_text(json.dumps({"floor_us": "kept"}))
    monkeypatch.setattr("sys.argv", ["bench", "--part", "forecast", "--quick", "--out", str(out)])
    bench.main()
    results: dict[str, Any] = json.loads(out.read_text())
    assert results["floor_us"] == "kept"
    found = results["forecast"]
    assert abs(found["orders"] - 2000) <= 100
    assert found["python"]["calls"] == 2
    assert 0.0 < found["python"]["to_ranking"] < 1.0
    said = " ".join(forecast_sentences(found))
    assert f"The probabilities of {found['orders']:,} orders, and the trajectories of the 64 most probable" in said
    assert "`Planner::forecast`: cmake or ninja is not installed." in said
    assert "of 30 vehicles with more orders than it predicts by default: 2666 of them in" in said
    assert forecast_sentences(None) == []


def test_python_predicts_as_many_orders_as_are_said() -> None:
    scene, _ = traffic_with_orders(forecast_bench.ORDERS)
    row = python_times(scene, 1, 2)
    assert row["calls"] == 2


def test_cpp_times_the_same_traffic() -> None:
    scene = traffic()
    row = cpp_times(scene, 1, 3)
    assert row["calls"] == 3
    assert row["forecast_ms"]["best"] > 0.0
    assert row["ranking_ms"]["best"] > 0.0
