"""A traffic as its users make it: what it keeps, and what is refused in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from intersection_env import Traffic, Vehicle
from tests.support.busy_traffic import T, busy


def arrays(count: int = 2, **changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "route": np.zeros(count, np.int32),
        "position": np.array([50.0, 100.0], np.float32)[:count],
        "speed": np.full(count, 5.0, np.float32),
        "length": np.full(count, 4.5, np.float32),
        "width": np.full(count, 1.8, np.float32),
    }
    return fields | changes


def test_traffic_keeps_its_own_arrays() -> None:
    position = np.array([50.0, 100.0], np.float32)
    traffic = Traffic(T, ("x", "y"), **arrays(position=position))
    position[0] = 5.0
    assert traffic.position[0] == 50.0
    with pytest.raises(ValueError, match="read-only"):
        traffic.position[0] = 1.0
    assert traffic == traffic
    assert len({traffic}) == 1


def test_words_and_assignments_are_inverse() -> None:
    traffic = busy()
    generator = np.random.default_rng(0)
    for _ in range(20):
        assignment = generator.integers(-1, 2, len(traffic.conflicts)).astype(np.int8)
        np.testing.assert_array_equal(traffic.assign(traffic.words(assignment)), assignment)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"speed": np.zeros(2)}, TypeError, "speed must be an array of float32, not float64"),
        ({"route": np.zeros(2, np.int64)}, TypeError, "route must be an array of int32, not int64"),
        ({"speed": [1.0, 2.0]}, TypeError, "speed must be an array of float32, not list"),
        ({"speed": np.zeros(3, np.float32)}, ValueError, r"speed must have shape \(2,\)"),
        ({"length": np.array([4.0, -1.0], np.float32)}, ValueError, "vehicle y: length must be from 0.1.* not -1.0"),
        ({"speed": np.array([np.nan, 1.0], np.float32)}, ValueError, "vehicle x: speed must be .* not nan"),
        ({"speed": np.array([1.0, -2.0], np.float32)}, ValueError, "vehicle y: speed must be .* not -2.0"),
        ({"position": np.array([1.0, 999.0], np.float32)}, ValueError, "vehicle y: position must be from 0.* not 999"),
        ({"route": np.array([0, 99], np.int32)}, ValueError, "vehicle y: route 99 is not one of the map's 6"),
        ({"max_speed": np.zeros(2, np.float32)}, ValueError, "vehicle x: max_speed must be at least 0.1"),
    ],
)
def test_wrong_traffic_is_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Traffic(T, ("x", "y"), **arrays(**changes))


def test_an_id_names_one_vehicle() -> None:
    with pytest.raises(TypeError, match="ids must be strings, not 3"):
        Traffic(T, (3, 4), **arrays())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match='the id "x" names two vehicles'):
        Traffic(T, ("x", "x"), **arrays())


def test_more_vehicles_than_a_traffic_may_hold_are_refused() -> None:
    vehicles = [Vehicle(str(k), "W-E", 1.0 + 4.6 * k, 0.0, length=4.0) for k in range(65)]
    with pytest.raises(ValueError, match="65 vehicles are more than the 64"):
        Traffic.of(T, vehicles)


@pytest.mark.parametrize("wrong", ["12", None, True])
def test_what_is_no_number_is_refused_by_name(wrong: Any) -> None:
    with pytest.raises(TypeError, match=rf"speed of vehicle b is {wrong!r}; wanted a number"):
        Traffic.of(T, [Vehicle("a", "W-E", 0.0, 8.0), Vehicle("b", "W-E", 40.0, wrong)])
