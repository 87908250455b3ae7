"""Places on the ground are put on the routes that fit, as recorded tracks are."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from intersection_env import Intersection, Traffic, Vehicle
from intersection_env.maps.intersection import Sample


def on_ground(intersection: Intersection, route: int, position: float, left: float) -> tuple[float, float, float]:
    """x, y and heading of a place `left` metres beside an arc length."""
    row = intersection.sample(route, np.array([position], np.float32))[0].astype(np.float64)
    x, y, heading = row[Sample.X], row[Sample.Y], row[Sample.HEADING]
    return float(x - left * np.sin(heading)), float(y + left * np.cos(heading)), float(heading)


def test_places_beside_a_route_are_found_where_they_were_put(intersection: Intersection) -> None:
    generator = np.random.default_rng(0)
    found = 0
    for _ in range(400):
        route = intersection.routes[int(generator.integers(len(intersection.routes)))]
        position = float(generator.uniform(0.5, route.length - 0.5))
        left, turn = float(generator.uniform(-0.6, 0.6)), float(generator.uniform(-0.5, 0.5))
        x, y, heading = on_ground(intersection, route.index, position, left)
        places = {place.route: place for place in intersection.locate(x, y, heading + turn)}
        assert route.id in places
        place = places[route.id]
        bent = abs(left) * 0.2  # inside of a bend the nearest place is up to so much elsewhere
        assert place.position == pytest.approx(position, abs=0.05 + bent)
        assert place.left == pytest.approx(left, abs=0.02)
        assert place.turn == pytest.approx(turn, abs=0.05 + bent)
        found += len(places) > 1
    assert found > 100, "lanes that routes share"


def test_the_nearest_place_is_that_of_shapely(intersection: Intersection) -> None:
    generator = np.random.default_rng(1)
    for route in intersection.routes:
        xy = route.samples[:, :2].astype(np.float64)
        points = np.ascontiguousarray(
            generator.uniform(xy.min(axis=0) - 5.0, xy.max(axis=0) + 5.0, (300, 2)), dtype=np.float64
        )
        position, distance, excess = intersection.core.project(route.index, points)
        line = shapely.LineString(xy)
        np.testing.assert_allclose(distance, shapely.distance(line, shapely.points(points)), atol=1e-9)
        along = shapely.line_locate_point(line, shapely.points(points))
        chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
        wanted = np.minimum(np.interp(along, chords, intersection.spacing * np.arange(len(xy))), route.length)
        clear = np.abs(position - wanted) < 1e-6
        assert clear.mean() > 0.99, "but where two places are equally near"
        width = intersection.sample(route.index, position.astype(np.float32))[:, Sample.WIDTH]
        np.testing.assert_allclose(excess, np.maximum(distance - np.maximum((width - 3.5) / 2, 0.0), 0.0), atol=1e-5)


def test_the_smallest_offset_comes_first_and_equal_ones_in_the_order_of_routes(intersection: Intersection) -> None:
    for route in intersection.routes:
        places = intersection.locate(*on_ground(intersection, route.index, route.stop_line - 20.0, 0.3))
        offsets = [abs(place.left) for place in places]
        assert offsets == pytest.approx(sorted(offsets), abs=2e-3)
        index = [intersection.route_index(place.route) for place in places if abs(place.left - 0.3) < 1e-3]
        assert index == sorted(index)
        assert route.index in index


def test_who_heads_the_other_way_or_is_far_off_fits_no_route_there(intersection: Intersection) -> None:
    route = intersection.routes[0]
    x, y, heading = on_ground(intersection, 0, route.stop_line - 30.0, 0.0)
    assert route.id in {place.route for place in intersection.locate(x, y, heading)}
    assert route.id not in {place.route for place in intersection.locate(x, y, heading + np.pi)}
    assert route.id in {place.route for place in intersection.locate(x, y, heading + np.pi, turned=np.pi)}
    assert intersection.locate(1e4, 1e4, heading) == ()
    x, y, heading = on_ground(intersection, 0, route.stop_line - 30.0, 8.0)
    assert route.id not in {place.route for place in intersection.locate(x, y, heading)}
    assert route.id in {place.route for place in intersection.locate(x, y, heading, aside=8.5)}


def test_ends_of_routes_are_not_beside_them(intersection: Intersection) -> None:
    for position in (-3.0, intersection.routes[0].length + 3.0):
        end = min(max(position, 0.0), intersection.routes[0].length)
        x, y, heading = on_ground(intersection, 0, end, 0.0)
        beyond = position - end
        places = intersection.locate(x + beyond * np.cos(heading), y + beyond * np.sin(heading), heading)
        assert intersection.routes[0].id not in {place.route for place in places}


def test_a_place_is_what_a_vehicle_takes(intersection: Intersection) -> None:
    place = intersection.locate(*on_ground(intersection, 0, 30.0, 0.0))[0]
    traffic = Traffic.of(intersection, [Vehicle("a", place.route, place.position, 5.0)])
    assert traffic.position[0] == pytest.approx(30.0, abs=0.01)


@pytest.mark.parametrize("x", [float("nan"), float("inf")])
def test_what_is_no_number_is_refused(intersection: Intersection, x: float) -> None:
    with pytest.raises(ValueError, match="x must be a number, not"):
        intersection.locate(x, 0.0, 0.0)
