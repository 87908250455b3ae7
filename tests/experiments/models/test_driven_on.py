"""SUMO drives on in the order that is imposed, or by its own; all in another process, since libsumo may crash."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from experiments.models.driven_on import Driven, DriveOn, Job, driven_on, drivers_of
from experiments.models.from_trajectories import minimum_distance
from intersection_env import Intersection, Traffic, Vehicle

BENDPLATZ = Intersection.load("bendplatz")
STEPS = 100
NEAR = Vehicle("near", "NW-SE", 0.0, 11.0)


def line(route: str) -> float:
    return BENDPLATZ.routes[BENDPLATZ.route_index(route)].stop_line


def waiting(before: float, speed: float = 0.0) -> Vehicle:
    """Of the side road, with its front so far before its line."""
    return Vehicle("waiting", "SW-NE", line("SW-NE") - before - 2.25, speed)


def job(*vehicles: Vehicle, first: str = "", second: str = "", seed: int = 3) -> Job:
    """Without an order, and with the one told."""
    traffic = Traffic.of(BENDPLATZ, vehicles)
    orders = (None, traffic.assign([(first, second)])) if first else (None, None)
    return Job(traffic, drivers_of(traffic, ["car"] * len(traffic), 0, 7), seed, orders, STEPS)


def near(before: float) -> Vehicle:
    """Of the main road, with its front so far before its line."""
    return NEAR._replace(position=line("NW-SE") - before - 2.25)


JOBS = {
    "side_first": job(waiting(1.5), near(45.0), first="waiting", second="near"),
    "main_first": job(waiting(1.5), near(45.0), first="near", second="waiting"),
    "late": job(waiting(1.5), near(8.0), first="near", second="waiting"),
    "on_the_line": job(near(25.0), waiting(0.1), first="near", second="waiting"),
    "twice": job(waiting(1.5), near(45.0)),
    "hard": job(waiting(1.5), near(16.5), first="waiting", second="near"),
}


@pytest.fixture(scope="module")
def found() -> dict[str, list[Driven]]:
    return dict(zip(JOBS, driven_on(list(JOBS.values())), strict=True))


def crossing_steps(name: str, driven: Driven) -> tuple[dict[str, int], dict[str, int]]:
    """When each vehicle's front reached the conflict, and when its centre had left it; `STEPS` + 1: never."""
    traffic = JOBS[name].traffic
    conflict = next(
        one
        for one in BENDPLATZ.conflicts
        if (one.yielder, one.prioritized) == (BENDPLATZ.route_index("SW-NE"), BENDPLATZ.route_index("NW-SE"))
    )
    interval = {"waiting": conflict.on_yielder, "near": conflict.on_prioritized}
    enters, clears = {}, {}
    for i, id in enumerate(traffic.ids):
        centre = driven.motions.position[:, i]
        enters[id] = int(np.append(centre + 2.25 >= interval[id][0], True).argmax())
        clears[id] = int(np.append(centre >= interval[id][1], True).argmax())
    return enters, clears


def test_who_goes_second_enters_when_the_first_has_cleared(found: dict[str, list[Driven]]) -> None:
    for name, first, second in (("side_first", "waiting", "near"), ("main_first", "near", "waiting")):
        with_order = found[name][1]
        enters, clears = crossing_steps(name, with_order)
        assert not with_order.unheld
        assert clears[first] < enters[second] < STEPS
        assert minimum_distance(JOBS[name].traffic, *with_order.motions) > 0.5
    assert found["main_first"][1].motions.position[-1, 0] > found["main_first"][1].motions.position[0, 0] + 30.0


def test_who_goes_first_does_not_wait_for_a_sign(found: dict[str, list[Driven]]) -> None:
    speed = found["side_first"][1].motions.speed[:, 0]
    assert (np.diff(speed[2:20]) >= -1e-3).all()
    enters, _ = crossing_steps("side_first", found["side_first"][1])
    assert enters["waiting"] * 0.2 < 4.0


def test_vehicle_that_cannot_stop_is_named_and_drives_on(found: dict[str, list[Driven]]) -> None:
    late = job(waiting(1.5), near(8.0))
    order = np.full(len(late.traffic.conflicts), 1, np.int8)  # no prediction would accept it
    (run,) = driven_on([late._replace(orders=(order,))])[0]
    assert run.unheld == (1,)
    assert run.motions.speed[:10, 1].min() > 8.0
    assert found["late"][1].unheld == ()


def test_braking_for_an_order_stays_below_the_hardest(found: dict[str, list[Driven]]) -> None:
    braking = -np.diff(found["hard"][1].motions.speed[:, 1]) / 0.2
    assert not found["hard"][1].unheld
    assert 3.5 < braking.max() <= 5.5 + 1e-3


def test_vehicle_told_to_wait_that_stands_at_its_line_stops_nobody(found: dict[str, list[Driven]]) -> None:
    """SUMO's junction begins 0.7 m before the line, and SUMO's drivers wait for whoever is in it."""
    without, with_order = found["on_the_line"]
    enters, _ = crossing_steps("on_the_line", with_order)
    assert enters["near"] * 0.2 < 4.0
    assert np.ptp(with_order.motions.position[: enters["near"], 1]) == 0.0
    assert without.motions.position[-1, 1] > without.motions.position[0, 1]


def test_same_job_is_driven_alike_and_another_seed_not(found: dict[str, list[Driven]]) -> None:
    one, other = found["twice"]
    np.testing.assert_array_equal(one.motions.position, other.motions.position)
    np.testing.assert_array_equal(one.motions.position, found["side_first"][0].motions.position)
    (again,) = driven_on([JOBS["twice"]._replace(seed=4, orders=(None,))])[0]
    assert (again.motions.position != one.motions.position).any()


def test_drivers_are_the_same_for_the_same_seed_moment_and_vehicle() -> None:
    traffic = JOBS["twice"].traffic
    kinds = ["bicycle", "truck_bus"]
    one = drivers_of(traffic, kinds, 0, 7)
    assert one == drivers_of(traffic, kinds, 0, 7)
    assert one[1] == drivers_of(traffic, ["car", "truck_bus"], 0, 7)[1]
    assert one[0].traits != drivers_of(traffic, kinds, 1, 7)[0].traits != drivers_of(traffic, kinds, 0, 8)[0].traits
    assert [driver.kind for driver in one] == kinds
    assert [driver.route for driver in one] == ["SW-NE", "NW-SE"]
    with pytest.raises(ValueError, match='not for "pedestrian"'):
        drivers_of(traffic, ["pedestrian", "car"], 0, 7)


def test_missing_sumo_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "libsumo", None)
    with (
        pytest.raises(ModuleNotFoundError, match=r"sumo is not installed: pip install -e '\.\[sumo\]'"),
        DriveOn(),
    ):
        pass


def test_traffic_on_another_map_is_refused() -> None:
    other = Intersection.load("t_junction")
    traffic = Traffic.of(other, [Vehicle("a", other.routes[0].id, 10.0, 5.0)])
    with pytest.raises(ValueError, match="traffic is on Intersection"):
        DriveOn().drive(Job(traffic, drivers_of(traffic, ["car"], 0, 0), 1, (None,), STEPS), None)
