"""Stops are made, an all-way stop clears in order of arrival, and a maneuver changes the order, not the stop."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.prediction.predictor import Prediction

DRIVERS = ("idm", "rollout_gradient", "gail", "ppo")
FOUR = ("W-E", "N-S", "E-W", "S-N")


def line(intersection: Intersection, route: str) -> float:
    return float(intersection.routes[intersection.route_index(route)].stop_line)


def car(intersection: Intersection, route: str, before: float, speed: float = 0.0) -> Vehicle:
    """A car of 4.5 m whose front is so far before its line."""
    return Vehicle(route, route, line(intersection, route) - before - 2.25, speed)


def drives(predictor: Predictor, traffic: Traffic, seconds: int) -> list[Prediction]:
    """Predictions that follow each other, 10 s each."""
    found = []
    for _ in range(seconds // 10):
        found.append(predictor.predict(traffic))
        traffic = found[-1].traffic_at(10.0)
    return found


def crossing_times(intersection: Intersection, drive: list[Prediction]) -> dict[str, float]:
    """When each vehicle's front crosses its line [s]."""
    return first_times(intersection, drive, lambda to_line, _: to_line < 0.0)


def stop_times(intersection: Intersection, drive: list[Prediction]) -> dict[str, float]:
    """When each vehicle has made its stop [s]."""
    return first_times(intersection, drive, lambda to_line, speed: (speed < 0.5) & (to_line < 3.0))


def first_times(
    intersection: Intersection,
    drive: list[Prediction],
    holds: Callable[[NDArray[np.floating], NDArray[np.floating]], NDArray[np.bool_]],
) -> dict[str, float]:
    """When something first holds of each vehicle's distance to its line and speed [s]."""
    times: dict[str, float] = {}
    for number, part in enumerate(drive):
        for index, id in enumerate(part.traffic.ids):
            to_line = line(intersection, id) - part.position[0, :, index] - part.traffic.length[index] / 2
            steps = np.flatnonzero(holds(to_line, part.speed[0, :, index]))
            if len(steps):
                times.setdefault(id, 10.0 * number + float(part.time[steps[0]]))
    return times


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize(("name", "route"), [("all_way_stop", "W-N"), ("bendplatz", "NE-SW")])
def test_lone_car_makes_its_stop_and_goes_on(driver: str, name: str, route: str) -> None:
    intersection = Intersection.load(name)
    drive = drives(Predictor.load(driver), Traffic.of(intersection, [car(intersection, route, 45.0, 8.0)]), 40)
    position = np.concatenate([part.position[0, :-1, 0] for part in drive if len(part.traffic)])
    speed = np.concatenate([part.speed[0, :-1, 0] for part in drive if len(part.traffic)])
    to_line = line(intersection, route) - position - 2.25
    stopped = np.flatnonzero((speed < 0.5) & (to_line < 3.0))
    assert len(stopped)
    assert to_line[stopped[0]] >= 0.0
    assert to_line.min() < -15.0, "it never goes on"


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("order", [("W-E", "N-S", "E-S"), ("N-S", "W-E", "S-W"), ("E-S", "S-W", "N-S", "W-N")])
def test_who_arrived_first_goes_first_wherever_it_comes_from(driver: str, order: tuple[str, ...]) -> None:
    intersection = Intersection.load("all_way_stop")
    cars = [car(intersection, route, 2.0 + 14.0 * turn, 0.0 if turn == 0 else 5.0) for turn, route in enumerate(order)]
    drive = drives(Predictor.load(driver), Traffic.of(intersection, cars), 60)
    times, stops = crossing_times(intersection, drive), stop_times(intersection, drive)
    assert sorted(times) == sorted(order)
    crossed = sorted(times, key=times.__getitem__)
    arrived = [stops[id] for id in crossed]
    assert arrived == sorted(arrived)
    if len(set(arrived)) == len(order):
        assert crossed == list(order)
    else:
        assert driver == "gail", "who creeps to its line is caught up with, and two may stop at once"
        assert len(set(arrived)) == len(order) - 1
    assert min(float(part.minimum_distance[0]) for part in drive) > 0.3


@pytest.mark.parametrize("driver", DRIVERS)
def test_of_two_that_arrive_at_once_the_one_from_the_right_goes_first(driver: str) -> None:
    intersection = Intersection.load("all_way_stop")
    for right, left in pairwise((*FOUR, FOUR[0])):
        cars = [car(intersection, route, 2.0) for route in (left, right)]
        times = crossing_times(intersection, drives(Predictor.load(driver), Traffic.of(intersection, cars), 40))
        assert times[right] < times[left]


def test_of_two_that_come_to_their_lines_alike_the_one_of_the_lower_rank_goes_first() -> None:
    intersection, predictor, alike = Intersection.load("all_way_stop"), Predictor.load("idm"), 0
    for conflict in intersection.conflicts:
        routes = [intersection.routes[index] for index in (conflict.yielder, conflict.prioritized)]
        cars = [car(intersection, route.id, 30.0, 8.0) for route in routes]
        drive = drives(predictor, Traffic.of(intersection, cars), 20)
        stops, times = stop_times(intersection, drive), crossing_times(intersection, drive)
        first, second = (route.id for route in sorted(routes, key=lambda route: route.rank))
        if stops[first] == stops[second]:
            assert times[first] < times[second]
            alike += 1
    assert alike > 10


@pytest.mark.parametrize("driver", DRIVERS)
def test_four_that_arrive_at_once_clear(driver: str) -> None:
    intersection = Intersection.load("all_way_stop")
    cars = [car(intersection, route, 2.0) for route in FOUR]
    drive = drives(Predictor.load(driver), Traffic.of(intersection, cars), 60)
    assert set(crossing_times(intersection, drive)) == set(FOUR)
    assert not len(drive[-1].traffic_at(10.0))
    assert min(float(part.minimum_distance[0]) for part in drive) > 0.3


@pytest.mark.parametrize("driver", DRIVERS)
def test_maneuver_overrides_the_order_of_arrival_but_not_the_stop(driver: str) -> None:
    intersection = Intersection.load("all_way_stop")
    traffic = Traffic.of(intersection, [car(intersection, "N-S", 2.0), car(intersection, "W-E", 16.0, 6.0)])
    predictor = Predictor.load(driver)
    by_arrival, ordered = predictor.predict(traffic), predictor.predict(traffic, [("W-E", "N-S")])
    first = crossing_times(intersection, [by_arrival])
    assert first["N-S"] < first.get("W-E", 99.0)
    told = crossing_times(intersection, [ordered])
    assert told["W-E"] < told.get("N-S", 99.0)
    front = ordered.position[0, :, 1] + 2.25
    before = front <= line(intersection, "W-E")
    assert ordered.speed[0, before, 1].min() < 0.5, "the stop is still made"
    assert ordered.waited is not None
    assert ordered.waited[0, -1, 1] > 0


@pytest.mark.parametrize("driver", DRIVERS)
def test_prediction_goes_on_with_what_was_waited(driver: str) -> None:
    intersection = Intersection.load("all_way_stop")
    cars = [
        car(intersection, "N-S", 8.0, 4.0),
        car(intersection, "W-E", 18.0, 6.0),
        car(intersection, "S-W", 30.0, 7.0),
    ]
    predictor = Predictor.load(driver)
    whole = predictor.predict(Traffic.of(intersection, cars))
    for step in (5, 17, 30):
        later = whole.traffic_at(0.2 * step)
        rest = predictor.predict(later)
        np.testing.assert_array_equal(rest.position[0, : 51 - step], whole.position[0, step:])
        assert rest.waited is not None
        assert whole.waited is not None
        np.testing.assert_array_equal(rest.waited[0, : 50 - step], whole.waited[0, step:50])
