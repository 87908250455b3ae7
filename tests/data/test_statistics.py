"""The figures of the scenes come out as the scenes were made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data.build import build
from data.describe.gaps import critical_gap, offered_gaps, open_pairs
from data.describe.statistics import main, statistics
from intersection_env.maps.intersection import Intersection
from tests.support.recordings import Floats, on_route, steady, write_recording


def waiting(time: Floats) -> Floats:
    """Reaches its line after 5 s, stands there for 8 s, and goes."""
    return np.interp(time, [0.0, 5.0, 13.0, 20.0], [50.0, 83.5, 83.5, 130.0])


def test_critical_gap_is_recovered_from_drivers_of_known_manner() -> None:
    generator = np.random.default_rng(1)
    seconds = generator.uniform(0.0, 10.0, 20000)
    share = 1.0 / (1.0 + np.exp(-(seconds - 5.5) * 1.25))
    accepted = (generator.uniform(size=20000) < share).astype(np.float64)
    found = critical_gap(seconds, accepted)
    assert found is not None
    critical, width = found
    assert critical == pytest.approx(5.5, abs=0.1)
    assert width == pytest.approx(2.0 * np.log(9.0) / 1.25, abs=0.2)


def test_critical_gap_without_a_tendency_is_none() -> None:
    seconds = np.linspace(0.0, 10.0, 50)
    for accepted in (np.ones(50), np.zeros(50), (seconds < 5.0).astype(np.float64)):
        assert critical_gap(seconds, accepted) is None
    assert critical_gap(seconds, (seconds > 5.0).astype(np.float64)) == pytest.approx((5.0, 0.0), abs=0.2)


def test_gaps_are_counted_from_the_line_and_from_the_last_vehicle_let_pass(
    tmp_path: Path, bendplatz: Intersection
) -> None:
    conflicts = {(bendplatz.routes[c.yielder].id, bendplatz.routes[c.prioritized].id): c for c in bendplatz.conflicts}
    conflict = conflicts["SW-NE", "NW-SE"]
    movers = [
        on_route(bendplatz, "SW-NE", 1, 0.0, waiting, 20.0),
        on_route(bendplatz, "NW-SE", 2, 0.0, steady(100.0, 7.0), 15.0),
        on_route(bendplatz, "NW-SE", 3, 0.0, steady(70.0, 8.0), 15.0),
        on_route(bendplatz, "NW-SE", 4, 0.0, steady(5.0, 8.0), 20.0),
    ]
    write_recording(tmp_path, "07", movers)
    scenes = build(tmp_path, bendplatz, progress=False)
    gaps = list(offered_gaps(scenes[0], bendplatz))
    assert [(gap.prioritized, gap.accepted) for gap in gaps] == [("07/2", False), ("07/3", False), ("07/4", True)]
    pairs = [(pair.prioritized, pair.yielder_first) for pair in open_pairs(scenes[0], bendplatz)]
    assert pairs == [("07/2", False), ("07/3", False), ("07/4", True)]
    line = bendplatz.routes[bendplatz.route_index("SW-NE")].stop_line
    at_line = 5.0 * (line - 2.0 - 2.25 - 50.0) / 33.5
    begin, end = conflict.on_prioritized
    arrivals = [(begin - 2.25 - start) / speed for start, speed in ((100.0, 7.0), (70.0, 8.0), (5.0, 8.0))]
    cleared = [(end - start) / speed for start, speed in ((100.0, 7.0), (70.0, 8.0))]
    expected = np.array(arrivals) - [at_line, *cleared]
    assert np.allclose([gap.seconds for gap in gaps], expected, atol=0.02)


def test_led_vehicle_is_offered_no_gap(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "SW-NE", 1, 0.0, waiting, 20.0),
        on_route(bendplatz, "SW-NW", 5, 0.0, lambda t: waiting(t) - 7.0, 20.0),
        on_route(bendplatz, "NW-SE", 2, 0.0, steady(100.0, 7.0), 15.0),
    ]
    write_recording(tmp_path, "07", movers)
    scenes = build(tmp_path, bendplatz, progress=False)
    assert {gap.yielder for gap in offered_gaps(scenes[0], bendplatz)} == {"07/1"}
    assert {pair.yielder for pair in open_pairs(scenes[0], bendplatz)} == {"07/1"}


def test_figures_describe_the_scenes(
    tmp_path: Path, bendplatz: Intersection, capsys: pytest.CaptureFixture[str]
) -> None:
    movers = [
        on_route(bendplatz, "SW-NE", 1, 0.0, waiting, 20.0),
        on_route(bendplatz, "SW-NE", 2, 0.0, lambda t: waiting(t) - 10.0, 20.0),
        on_route(bendplatz, "SE-NW", 3, 0.0, steady(130.0, 4.0), 20.0, "bicycle"),
    ]
    write_recording(tmp_path, "07", movers, location=901)
    scenes = build(tmp_path, bendplatz, progress=False)
    figures = statistics(scenes)
    assert figures.vehicles == {"bicycle": 1, "car": 2}
    assert figures.hours == pytest.approx(20.2 / 3600.0)
    assert figures.smallest_gap == pytest.approx(5.5, abs=0.02)
    assert figures.standing == pytest.approx((8.0, 8.0), abs=0.4)
    assert figures.overlapping == 0
    assert not figures.meets_bars
    scenes.save(tmp_path / "scenes.npz")
    assert main([str(tmp_path / "scenes.npz")]) == 0
    printed = capsys.readouterr().out
    assert "1 bicycle, 2 car" in printed
    rows = {line[:31].rstrip(): line[31:].split("  ")[0] for line in printed.splitlines()}
    assert rows["all bars reached"] == "NO"
    assert rows["slowest in junction, right"] == "too few vehicles"
    assert "6.2 s" in next(line for line in printed.splitlines() if line.startswith("critical gap"))  # the real one


def test_missing_scenes_file_is_an_error_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nowhere.npz"]) == 1
    assert 'error: "nowhere.npz": no scenes file' in capsys.readouterr().err
