"""Tracks are extended into the past, as far as that is possible."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from data.pipeline.shared_lanes import overlap_length, pair_gap
from intersection_env.maps.intersection import Intersection
from tests.support.built_scenes import scenes_of
from tests.support.recordings import Floats, on_route, steady


def test_extension_is_cut_where_it_would_overlap(tmp_path: Path, bendplatz: Intersection) -> None:
    def slow_down(time: Floats) -> Floats:
        return np.asarray(108.0 + np.where(time < 2.0, 4.0 * time, 8.0 + 9.0 * (time - 2.0)))

    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "NW-SE", 2, 20.0, steady(110.0, 9.0), 8.0),
        on_route(bendplatz, "NW-SE", 3, 21.2, slow_down, 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    assert dropped["extrapolation: cut at another vehicle"] == 1
    assert dropped["extrapolation: steps cut at another vehicle"] >= 1
    gap = pair_gap(scene.track("07/2"), scene.track("07/3"), bendplatz)
    assert gap is not None
    assert (-gap.ahead > overlap_length(scene.track("07/2"), scene.track("07/3"))).all()
    assert 0 < (~scene.track("07/3").observed).sum() < 30


def test_extension_stops_at_the_start_of_the_route(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "SW-NE", 2, 10.0, steady(40.8, 8.0), 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    track = scene.track("07/2")
    assert 0.0 <= track.position[0] < 1.6
    assert (~track.observed).sum() == 25
    assert dropped["extrapolation: reaches the start of the route"] == 1


def test_track_first_seen_in_the_junction_is_not_extended(tmp_path: Path, bendplatz: Intersection) -> None:
    movers = [
        on_route(bendplatz, "NW-SE", 1, 0.0, steady(60.0, 5.0), 20.0),
        on_route(bendplatz, "SW-NE", 2, 8.0, steady(88.0, 5.0), 8.0),
    ]
    (scene,), dropped = scenes_of(tmp_path, bendplatz, movers)
    assert scene.track("07/2").observed.all()
    assert scene.track("07/2").start == 40
    assert dropped["extrapolation: first seen beyond the stop line"] == 1
