"""The road as it is seen from above is where the map says."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from intersection_env import Intersection
from intersection_env.maps.intersection import XY, Route, Sample
from intersection_env.maps.meeting import SWEPT_WIDTH
from intersection_env.maps.outline import (
    along,
    band,
    conflict_areas,
    directions,
    extent,
    inside,
    junction_extent,
    marked,
    outside,
    painted_stop_lines,
    pavement,
    polygons,
    sides,
    stop_lines,
)


def centreline(route: Route) -> shapely.LineString:
    return shapely.LineString(route.samples[:, XY])


def test_sample_each_is_sample_one_by_one(intersection: Intersection) -> None:
    route = np.arange(len(intersection.routes))[::-1]
    position = np.linspace(3.0, 80.0, len(route), dtype=np.float32)
    rows = intersection.sample_each(route, position)
    for row, one, at in zip(rows, route.tolist(), position[:, None], strict=True):
        np.testing.assert_array_equal(row, intersection.sample(one, at)[0])
    assert intersection.sample_each(route[:0], position[:0]).shape == (0, rows.shape[1])


def test_sides_lie_half_a_lane_to_the_left_and_to_the_right(intersection: Intersection) -> None:
    for route in intersection.routes:
        samples = along(intersection, route, 10.0, 100.0)
        for side, way in zip(sides(samples), (1.0, -1.0), strict=True):
            off = side - samples[:, XY]
            ahead, left = directions(samples)
            assert (off * left).sum(axis=1) == pytest.approx(way * 0.5 * samples[:, Sample.WIDTH], abs=1e-4)
            assert (off * ahead).sum(axis=1) == pytest.approx(0.0, abs=1e-4)
        assert shapely.Polygon(band(samples, 1.0)).area == pytest.approx(90.0, rel=0.01)


def test_samples_along_a_route_are_half_a_metre_apart_and_reach_both_ends(intersection: Intersection) -> None:
    route = intersection.routes[0]
    samples = along(intersection, route, 5.2, 20.1)
    assert np.linalg.norm(np.diff(samples[:, XY], axis=0), axis=1).max() <= 0.501
    ends = intersection.sample(route.index, np.array([5.2, 20.1], np.float32))
    np.testing.assert_array_equal(samples[[0, -1]], ends)


def test_a_route_is_marked_outside_its_junction_whatever_the_resolution(intersection: Intersection) -> None:
    for route in intersection.routes:
        begin, end = route.junction
        line = centreline(route)
        for stretch in outside(intersection, route):
            place = shapely.line_locate_point(line, shapely.points(stretch[:, XY]))
            assert ((place < begin - 1.0) | (place > end + 1.0)).all()
        (zero, before), (behind, length) = marked(route)
        assert (zero, length) == (0.0, route.length)
        assert before < begin
        assert end < behind
        own = inside(intersection, route)
        place = np.array(shapely.line_locate_point(line, shapely.points(own[:, XY])))
        assert begin - 1.0 <= place[0] <= begin + 0.01
        assert end - 0.01 <= place[-1] <= end + 1.0


def test_pavement_is_the_same_fine_or_coarse_and_holds_every_centreline(intersection: Intersection) -> None:
    fine = pavement(along(intersection, route, 0.0, route.length) for route in intersection.routes)
    coarse = pavement((route.samples for route in intersection.routes), 0.01)
    for route in intersection.routes:
        assert centreline(route).difference(fine).length < 1.0 + 1e-6  # the last sample may lie behind the end
        assert centreline(route).difference(coarse).length < 1e-3
    assert fine.difference(coarse).area < 0.002 * fine.area
    assert coarse.difference(fine).area < 0.01 * fine.area


def test_slivers_between_lanes_are_paved(intersection: Intersection) -> None:
    route = intersection.routes[0]
    beside = along(intersection, route, 0.0, 40.0)
    other = beside.copy()
    _, left = directions(beside)
    other[:, XY] += (beside[:, [Sample.WIDTH]] + 1.0) * left
    (area,) = polygons(pavement([beside, other]))
    assert area.covers(shapely.LineString(beside[5:-5, XY] + 0.5 * (beside[5:-5, [Sample.WIDTH]] + 1.0) * left[5:-5]))
    other[:, XY] += 2.0 * left
    assert len(polygons(pavement([beside, other]))) == 2


def test_stop_line_lies_across_its_route_where_it_stops(intersection: Intersection) -> None:
    yielding = {conflict.yielder for conflict in intersection.conflicts}
    for route, line in zip(intersection.routes, stop_lines(intersection, 2.0), strict=True):
        at = intersection.sample(route.index, np.array([route.stop_line], np.float32))
        _, left = directions(at)
        assert line.ends.mean(axis=0) == pytest.approx(at[0, XY], abs=1e-4)
        assert line.ends[0] - line.ends[1] == pytest.approx(2.0 * left[0], abs=1e-4)
        assert line.must_yield == (route.index in yielding)
    for route, line in zip(intersection.routes, stop_lines(intersection, 100.0), strict=True):
        at = intersection.sample(route.index, np.array([route.stop_line], np.float32))
        assert np.linalg.norm(line.ends[0] - line.ends[1]) == pytest.approx(at[0, Sample.WIDTH], abs=1e-4)


def test_painted_stop_lines_are_shared_by_the_routes_of_a_lane_and_square_to_the_approach(
    intersection: Intersection,
) -> None:
    painted = list(painted_stop_lines(intersection, 2.8))
    assert len({route.stop_lane for route in intersection.routes}) <= len(painted) < len(intersection.routes)
    yielding = {conflict.yielder for conflict in intersection.conflicts}
    for route in intersection.routes:
        stop, begin = intersection.sample(route.index, np.array([route.stop_line, route.junction[0]], np.float32))
        nearest = min(painted, key=lambda line: float(np.linalg.norm(line.ends.mean(axis=0) - stop[XY])))
        assert np.linalg.norm(nearest.ends.mean(axis=0) - stop[XY]) < 2.0
        ahead, _ = directions(begin[None])
        assert abs((nearest.ends[0] - nearest.ends[1]) @ ahead[0]) < 0.1
        assert nearest.must_yield or route.index not in yielding


def test_conflict_areas_lie_in_what_both_routes_sweep(intersection: Intersection) -> None:
    for conflict in intersection.conflicts:
        areas = [shapely.Polygon(outline) for outline in conflict_areas(intersection, conflict)]
        assert sum(area.area for area in areas) > 0.05
        for route in (conflict.yielder, conflict.prioritized):
            swept = centreline(intersection.routes[route]).buffer(0.5 * SWEPT_WIDTH + 0.05)
            assert all(swept.covers(area) for area in areas)


def test_extent_of_a_junction_holds_it_and_some_of_every_arm(intersection: Intersection) -> None:
    low, high = junction_extent(intersection)
    within = extent(inside(intersection, route) for route in intersection.routes)
    assert (low + 8.0 <= within[0]).all()
    assert (within[1] <= high - 8.0).all()
    whole = extent(route.samples for route in intersection.routes)
    assert (whole[0] <= within[0]).all()
    assert (within[1] <= whole[1]).all()
