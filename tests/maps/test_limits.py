"""A map with other speed limits is the same map otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from intersection_env.maps.intersection import Intersection, Sample, shipped_maps
from intersection_env.maps.limits import with_limits


@pytest.mark.parametrize("name", shipped_maps())
def test_limits_alone_are_changed(name: str) -> None:
    plain = Intersection.load(name)
    changed = with_limits(plain, 1.25)
    assert changed.checksum != plain.checksum
    assert (changed.name, changed.conflicts, changed.shared_lanes) == (plain.name, plain.conflicts, plain.shared_lanes)
    for own, other in zip(changed.routes, plain.routes, strict=True):
        assert (own.id, own.length, own.stop_line, own.junction) == (
            other.id,
            other.length,
            other.stop_line,
            other.junction,
        )
        expected = other.samples.copy()
        expected[:, Sample.V_MAX] *= 1.25
        np.testing.assert_allclose(own.samples, expected, rtol=1e-6)


def test_limits_as_they_are_leave_the_map_as_it_is() -> None:
    plain = Intersection.load("bendplatz")
    assert with_limits(plain, 1.0) is plain


@pytest.mark.parametrize("times", [0.0, -1.0, float("nan")])
def test_limits_that_are_none_are_refused(times: float) -> None:
    with pytest.raises(ValueError, match="wanted a number above 0"):
        with_limits(Intersection.load("bendplatz"), times)
