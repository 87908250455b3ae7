"""Columns by name are the core's features in their order."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import pytest

from intersection_env import Intersection
from intersection_env.features import DRIVING_FEATURES, GAP_FEATURES, Driving, Gap
from intersection_env.maps.intersection import Sample

WORDS = {"FOE": "foe", "PGA": "pga", "V_MAX": "speed_limit", "HEADINGS": "relative_heading_-10m"}


@pytest.mark.parametrize(("columns", "features"), [(Gap, GAP_FEATURES), (Driving, DRIVING_FEATURES)])
def test_columns_bear_the_names_of_the_cores_features(columns: type[IntEnum], features: tuple[str, ...]) -> None:
    for column in columns:
        name = WORDS.get(column.name, column.name.lower())
        assert name in features[column], f"{column.name} is not {features[column]}"


def test_columns_of_a_map_are_what_they_say() -> None:
    for route in Intersection.load("t_junction").routes:
        x, y, heading = (route.samples[:, column] for column in (Sample.X, Sample.Y, Sample.HEADING))
        inside = slice(1, len(x) - 2)  # a central difference, hence without the ends
        along = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
        turned = (along - heading)[inside] / (2.0 * np.pi)
        np.testing.assert_allclose(turned, np.round(turned[0]), atol=0.02)
        assert set(np.round(3.6 * route.samples[:, Sample.V_MAX]).tolist()) <= {30.0, 50.0}
        assert ((route.samples[:, Sample.WIDTH] > 2.0) & (route.samples[:, Sample.WIDTH] < 7.0)).all()
        ahead = np.interp(np.arange(len(heading)) - 10.0, np.arange(len(heading)), heading) - heading
        np.testing.assert_allclose(route.samples[:, Sample.HEADINGS], ahead, atol=0.1)
