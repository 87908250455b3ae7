"""The twin by hand: the compiled map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.reference.intersection import Map, Sample, load_map, sample
from tests.support.paths import MAPS
from tests.support.placing import BOTH, T_JUNCTION
from tests.support.twins import twin_map


@pytest.mark.parametrize("at", [b"stop_line 149", b"map 2"])
def test_map_with_one_changed_byte_is_refused(tmp_path: Path, at: bytes) -> None:
    data = (MAPS / "t_junction.map").read_bytes()
    (tmp_path / "bad.map").write_bytes(data.replace(at, at[:-1] + b"7", 1))
    with pytest.raises(ValueError, match="checksum"):
        load_map(tmp_path / "bad.map")


def test_map_holds_what_its_file_says() -> None:
    assert [route.id for route in T_JUNCTION.routes] == ["W-E", "W-S", "E-W", "E-S", "S-W", "S-E"]
    assert (T_JUNCTION.routes[3].stop_line, T_JUNCTION.routes[3].first_conflict) == (153.5, 158.464968)
    assert (T_JUNCTION.conflicts[2].yielder, T_JUNCTION.conflicts[2].merging) == (5, True)
    assert (T_JUNCTION.shared_lanes[1].end, T_JUNCTION.shared_lanes[1].offset) == (1e6, -64.0820762)


@BOTH
def test_each_pair_of_routes_has_at_most_one_conflict(intersection: Map) -> None:
    pairs = [frozenset((c.yielder, c.prioritized)) for c in intersection.conflicts]
    assert len(pairs) == len(set(pairs))


def test_two_routes_around_a_roundabout_yield_to_each_other_once() -> None:
    pairs = [(c.yielder, c.prioritized) for c in twin_map("roundabout").conflicts]
    assert len(pairs) == len(set(pairs))
    assert any((b, a) in pairs for a, b in pairs)


def test_values_between_samples_are_linear_and_hold_beyond_the_ends() -> None:
    columns = [Sample.X, Sample.Y, Sample.HEADING, Sample.WIDTH, Sample.V_MAX]
    np.testing.assert_allclose(sample(T_JUNCTION, 0, 0.25)[columns], [-159.75, -1.65, 0, 3.25, 50 / 3.6], atol=1e-6)
    np.testing.assert_allclose(sample(T_JUNCTION, 0, -7.0)[columns[:2]], [-160, -1.65])
    np.testing.assert_allclose(sample(T_JUNCTION, 0, 999.0)[columns[:2]], [160, -1.65])
