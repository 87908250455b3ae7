"""The map of the recordings."""

from __future__ import annotations

import pytest

from intersection_env.maps.intersection import Intersection


@pytest.fixture(scope="session")
def bendplatz() -> Intersection:
    return Intersection.load("bendplatz")
