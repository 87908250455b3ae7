"""SUMO as a predictor drives what was recorded, from where it was; all in another process, since libsumo may crash."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.models.from_trajectories import prediction_of_trajectories
from experiments.models.sumo_predictor import StoredPredictions, SumoPredictor, predictions
from intersection_env import Intersection, Predictor, Scenes, Traffic, Vehicle
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.moments import moments_of

BENDPLATZ = Intersection.load("bendplatz")
MAIN_LIMIT = 50.0 / 3.6  # [m/s]
DAWDLING = 0.5 * 2.6 * 0.2  # [m/s], the most that SUMO's default driver (sigma 0.5, 2.6 m/s²) loses in a step
MOMENTS = moments_of(Scenes.load("bendplatz").select("development"))[0][::97]


def traffic(*vehicles: Vehicle) -> Traffic:
    return Traffic.of(BENDPLATZ, vehicles)


def line(route: str) -> float:
    return BENDPLATZ.routes[BENDPLATZ.route_index(route)].stop_line


WAITING = Vehicle("waiting", "SW-NE", line("SW-NE") - 4.0, 0.0)
MADE = {
    "lone": traffic(Vehicle("a", "NW-SE", 40.0, 8.0)),
    "free": traffic(WAITING),
    "held": traffic(WAITING, Vehicle("near", "NW-SE", line("NW-SE") - 25.0, 12.0)),
    "late": traffic(Vehicle("leaving", "NE-SW", 160.0, 8.0), Vehicle("beyond", "NW-SE", 319.0, 10.0), WAITING),
    "bicycle": traffic(Vehicle("b", "NW-SE", 40.0, 3.0, 1.8, 0.6, 4.0)),
    "again": traffic(WAITING, Vehicle("near", "NW-SE", line("NW-SE") - 25.0, 12.0)),
}


@pytest.fixture(scope="module")
def found() -> StoredPredictions:
    return predictions([*MADE.values(), *(one.traffic for one in MOMENTS)])


def test_recorded_vehicles_start_where_and_as_fast_as_they_were(found: StoredPredictions) -> None:
    inside = 0
    for one in MOMENTS:
        predicted = found.predict(one.traffic)
        np.testing.assert_allclose(predicted.position[0, 0], one.traffic.position, atol=1e-3)
        np.testing.assert_allclose(predicted.speed[0, 0], one.traffic.speed, atol=1e-3)
        moved = np.diff(predicted.position[0, :2], axis=0)[0]
        np.testing.assert_allclose(moved, 0.2 * predicted.speed[0, 1], atol=0.01)
        routes = [BENDPLATZ.routes[route] for route in one.traffic.route]
        front = one.traffic.position + 0.5 * one.traffic.length
        inside += sum(r.stop_line < s < r.junction[1] for r, s in zip(routes, front, strict=True))
        assert predicted.present[0, :2].all()  # SUMO took all of them in
    assert inside > 5  # some were in the junction


def test_lone_vehicle_takes_up_the_speed_limit(found: StoredPredictions) -> None:
    predicted = found.predict(MADE["lone"])
    speed = predicted.speed[0, :, 0]
    assert (speed <= MAIN_LIMIT + 1e-3).all()
    assert (speed[25:] >= MAIN_LIMIT - DAWDLING - 1e-3).all()
    np.testing.assert_allclose(predicted.position[0, :, 0], 40.0 + 0.2 * (np.cumsum(speed) - speed[0]), atol=0.01)
    np.testing.assert_allclose(np.diff(speed), 0.2 * predicted.acceleration[0, :-1, 0], atol=1e-4)
    assert np.isinf(predicted.minimum_distance[0])
    assert found.predict(MADE["bicycle"]).speed.max() == pytest.approx(4.0, abs=1e-3)


def test_yielder_waits_for_a_near_vehicle_and_goes_when_the_road_is_empty(found: StoredPredictions) -> None:
    free, held = found.predict(MADE["free"]), found.predict(MADE["held"])
    over = held.position[0, :, 1] > BENDPLATZ.routes[held.traffic.route[1]].junction[1]
    passed = int(over.argmax())
    assert over.any()
    assert free.enters[0, passed, 0]
    assert not held.enters[0, :passed, 0].any()
    assert held.enters[0, -1, 0]
    assert held.time_loss[0, 0] > free.time_loss[0, 0] + 1.0


def test_vehicles_that_left_are_absent_and_stay_as_they_were(found: StoredPredictions) -> None:
    predicted = found.predict(MADE["late"])
    present = predicted.present[0].sum(axis=0)
    assert 1 < present[0] < 51
    assert present[1] == 1  # its front was beyond the end from the first
    assert present[2] == 51
    for i, steps in enumerate(present):
        assert predicted.present[0, :steps, i].all()
        for values in (predicted.position, predicted.speed):
            assert np.ptp(values[0, steps - 1 :, i]) == 0.0
    length = BENDPLATZ.routes[predicted.traffic.route[0]].length
    assert 0.0 < length - predicted.position[0, -1, 0] < 0.5 * 4.5 + 0.2 * MAIN_LIMIT


def test_equal_traffic_is_predicted_equally(found: StoredPredictions) -> None:
    one, other = found.predict(MADE["held"]), found.predict(MADE["again"])
    for name in ("position", "speed", "acceleration", "enters", "present", "time_loss", "minimum_distance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_measures_are_those_of_our_own_predictions(found: StoredPredictions) -> None:
    """Shapes and types too; they are taken of the IDM's motions, of which ours are known."""
    for one in MOMENTS:
        ours = Predictor.load("idm").predict(one.traffic)
        measured = prediction_of_trajectories(one.traffic, ours.position[0], ours.speed[0], ours.present[0])
        np.testing.assert_allclose(measured.time_loss, ours.time_loss, atol=1e-3)
        np.testing.assert_allclose(measured.minimum_distance, ours.minimum_distance, atol=1e-3)
        for name in ("time", "position", "acceleration", "enters", "present", "time_loss", "minimum_distance"):
            theirs, wanted = getattr(found.predict(one.traffic), name), getattr(ours, name)
            assert (theirs.shape, theirs.dtype) == (wanted.shape, wanted.dtype)


def test_evaluation_takes_stored_predictions(found: StoredPredictions) -> None:
    assert set(evaluate(found, MOMENTS)["model"]) == {"sumo"}
    with pytest.raises(KeyError, match="none of the"):
        found.predict(traffic(WAITING))


def crash_once(mark: Path, saved: Traffic) -> Traffic:
    """Ends the process, unless that has happened before."""
    if mark.exists():
        return saved
    mark.touch()
    os._exit(1)


class Crashing:
    """What becomes a traffic in another process, which may not survive it."""

    def __init__(self, *arguments: object) -> None:
        self.arguments = arguments

    def __reduce__(self) -> tuple[object, ...]:
        return (crash_once, self.arguments) if self.arguments else (os._exit, (1,))


def test_what_a_crash_took_along_is_predicted_again(tmp_path: Path, found: StoredPredictions) -> None:
    crashing = Crashing(tmp_path / "crashed", MADE["held"])
    predicted = predictions([crashing]).predict(crashing)  # type: ignore[list-item,arg-type]
    assert (tmp_path / "crashed").exists()
    np.testing.assert_array_equal(predicted.position, found.predict(MADE["held"]).position)


def test_crashing_again_and_again_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="libsumo crashed 3 times at traffics 0 and on"):
        predictions([Crashing()])  # type: ignore[list-item]


def test_missing_sumo_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "libsumo", None)
    with (
        pytest.raises(ModuleNotFoundError, match=r"sumo is not installed: pip install -e '\.\[sumo\]'"),
        SumoPredictor(),
    ):
        pass


def test_traffic_on_another_map_is_refused() -> None:
    other = Intersection.load("t_junction")
    with pytest.raises(ValueError, match="traffic is on Intersection"):
        SumoPredictor().predict(Traffic.of(other, [Vehicle("a", other.routes[0].id, 10.0, 5.0)]))
