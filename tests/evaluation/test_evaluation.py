"""Errors are what a hand computes, of those vehicles that are to be scored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from intersection_env import Intersection, Predictor, Scene, Scenes, Traffic, Vehicle
from intersection_env.evaluation.errors import (
    AT_HORIZON,
    distance_error,
    error_figures,
    errors,
    evaluate,
    figures_until_last_seen,
)
from intersection_env.evaluation.moments import HORIZONS, Moment, moments_of
from intersection_env.prediction.measures import time_loss
from intersection_env.scenes.scene import Track

STEP = 0.2
Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def bendplatz() -> Intersection:
    return Intersection.load("bendplatz")


def track(
    intersection: Intersection,
    id: str,
    route: str,
    position: Floats,
    speed: Floats,
    road_user: str = "car",
    start: int = 0,
    extrapolated: int = 0,
) -> Track:
    """A track whose first states are extrapolated."""
    observed = np.arange(len(position)) >= extrapolated
    index, rest = intersection.route_index(route), np.zeros(len(position), np.float32)
    states = position.astype(np.float32), speed.astype(np.float32), rest
    return Track(id, road_user, index, 4.5, 1.8, start, *states, observed)


def scenes_of(intersection: Intersection, tracks: Sequence[Track], steps: int = 51) -> Scenes:
    scene = Scene("07/0", "07", "development", 0.0, steps, tuple(tracks))
    return Scenes(intersection, (scene,), {}, {})


def accelerating(position: float, speed: float, rate: float, steps: int = 51) -> tuple[Floats, Floats]:
    time: Floats = STEP * np.arange(steps, dtype=np.float64)
    return position + speed * time + 0.5 * rate * time**2, speed + rate * time


def first(scenes: Scenes) -> list[Moment]:
    return moments_of(scenes)[0][:1]


def at_horizons(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the paper's population and of those extrapolated."""
    return table[table["population"].isin(AT_HORIZON)]


def test_recording_that_came_as_predicted_has_no_error(intersection: Intersection) -> None:
    routes = [intersection.routes[0].id, intersection.routes[2].id]
    rows = [Vehicle(f"07/{k}", routes[k], 60.0 + 20.0 * k, 9.0) for k in range(2)]
    idm = Predictor.load("idm")
    future = idm.predict(Traffic.of(intersection, rows))
    tracks = [
        track(
            intersection,
            row.id,
            row.route,
            future.position[0, :, k].astype(np.float64),
            future.speed[0, :, k].astype(np.float64),
        )
        for k, row in enumerate(rows)
    ]
    table = evaluate(idm, first(scenes_of(intersection, tracks)))
    assert at_horizons(table)["horizon"].tolist() == list(HORIZONS)
    assert table["population"].tolist()[-2:] == ["until_last_seen", "last_seen"]
    assert (table["count"] == 2).all()
    assert (table[["rmse", "mad", "bias", "time_loss_rmse", "time_loss_q80"]].to_numpy() == 0.0).all()


def test_constant_velocity_misses_an_acceleration_by_half_its_square(bendplatz: Intersection) -> None:
    position, speed = accelerating(5.0, 4.0, 0.5)
    scenes = scenes_of(bendplatz, [track(bendplatz, "07/1", "SE-NW", position, speed)])
    table = evaluate(Predictor.load("constant_velocity"), first(scenes))
    v_max = 50.0 / 3.6
    for horizon, (_, row) in zip(HORIZONS, at_horizons(table).iterrows(), strict=True):
        steps = round(horizon / STEP)
        assert row["horizon"] == horizon
        assert row["rmse"] == pytest.approx(0.5 * 0.5 * horizon**2, abs=1e-3)
        assert row["mad"] == pytest.approx(0.5 * 0.5 * horizon**2, abs=1e-3)
        assert row["bias"] == pytest.approx(-0.5 * 0.5 * horizon**2, abs=1e-3)
        # it is thought to lose what it gained in speed: the sum of rate k dt over the steps before
        lost = STEP * 0.5 * STEP * steps * (steps - 1) / 2 / v_max
        assert row["time_loss_rmse"] == pytest.approx(lost, rel=1e-3)
        assert row["time_loss_q80"] == pytest.approx(lost, rel=1e-3)
    assert set(table["model"]) == {"constant_velocity"}


def test_rmse_mad_and_quantile_are_taken_over_the_vehicles(bendplatz: Intersection) -> None:
    rates = (0.0, 0.25, 0.5)
    routes = ("SE-NW", "NW-SE", "SW-NE")
    tracks = [track(bendplatz, f"07/{k}", routes[k], *accelerating(5.0, 3.0, rate)) for k, rate in enumerate(rates)]
    row = evaluate(Predictor.load("constant_velocity"), first(scenes_of(bendplatz, tracks))).iloc[0]
    errors = [0.5 * rate * 2.0**2 for rate in rates]
    assert row["rmse"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-3)
    assert row["mad"] == pytest.approx(errors[1], rel=1e-3)
    assert row["count"] == 3


def test_vehicles_extrapolated_at_the_start_have_rows_of_their_own(bendplatz: Intersection) -> None:
    tracks = [
        track(bendplatz, "07/1", "SE-NW", *accelerating(5.0, 4.0, 0.5)),
        track(bendplatz, "07/2", "NW-SE", *accelerating(5.0, 4.0, 0.2), extrapolated=15),
    ]
    table = evaluate(Predictor.load("constant_velocity"), first(scenes_of(bendplatz, tracks)))
    rows = table.set_index(["population", "horizon"])
    assert rows.loc[("recorded", 10.0), "rmse"] == pytest.approx(25.0, abs=1e-2)
    assert rows.loc[("extrapolated", 10.0), "rmse"] == pytest.approx(10.0, abs=1e-2)
    assert (rows["count"] == 1).all()
    # at 2 s, step 10, the second is not yet recorded: nothing to compare with
    assert ("extrapolated", 2.0) not in rows.index
    assert ("extrapolated", 4.0) in rows.index


def test_horizon_after_the_end_of_a_track_is_not_scored(bendplatz: Intersection) -> None:
    tracks = [track(bendplatz, "07/1", "SE-NW", *accelerating(5.0, 4.0, 0.0, steps=31))]
    table = evaluate(Predictor.load("idm"), first(scenes_of(bendplatz, tracks)))
    assert at_horizons(table)["horizon"].tolist() == [2.0, 4.0, 6.0]


def test_bicycles_take_part_but_are_not_scored(bendplatz: Intersection) -> None:
    car = track(bendplatz, "07/1", "SE-NW", *accelerating(20.0, 8.0, 0.0))
    bicycle = track(bendplatz, "07/2", "SE-NW", *accelerating(40.0, 3.0, 0.0), road_user="bicycle")
    truck = track(bendplatz, "07/3", "NW-SE", *accelerating(20.0, 8.0, 0.0), road_user="truck_bus")
    idm = Predictor.load("idm")
    alone = evaluate(idm, first(scenes_of(bendplatz, [car, truck])))
    together = evaluate(idm, first(scenes_of(bendplatz, [car, bicycle, truck])))
    assert together["count"].tolist() == alone["count"].tolist() == [2] * 7
    assert not np.allclose(together["rmse"], alone["rmse"])


def test_vehicle_predicted_to_leave_the_map_loses_no_time_after_that(bendplatz: Intersection) -> None:
    route = bendplatz.routes[bendplatz.route_index("SE-NW")]
    position, speed = accelerating(route.length - 25.0, 4.0, -0.4, steps=11)
    position, speed = (np.concatenate([one, np.full(40, one[-1])]) for one in (position, speed))
    scenes = scenes_of(bendplatz, [track(bendplatz, "07/1", "SE-NW", position, speed)])
    moments, constant = first(scenes), Predictor.load("constant_velocity")
    prediction = constant.predict(moments[0].traffic)
    assert not prediction.present[0, -1, 0]
    truth = time_loss(bendplatz, route.index, position.astype(np.float32), speed.astype(np.float32))
    at_10_s = at_horizons(evaluate(constant, moments)).iloc[-1]
    assert at_10_s["time_loss_rmse"] == pytest.approx(abs(prediction.time_loss[0, 0] - truth[50]), abs=1e-3)


def test_starts_are_a_second_apart_and_leave_two_seconds_to_compare(bendplatz: Intersection) -> None:
    scenes = scenes_of(bendplatz, [track(bendplatz, "07/1", "SE-NW", *accelerating(5.0, 4.0, 0.0, 61))], 61)
    moments, refused = moments_of(scenes)
    assert not refused
    np.testing.assert_allclose([moment.time for moment in moments], np.arange(0.0, 10.5))
    assert [moment.full for moment in moments] == [True] * 3 + [False] * 8


def test_moment_at_which_vehicles_overlap_is_counted_not_evaluated(bendplatz: Intersection) -> None:
    fast = track(bendplatz, "07/1", "SE-NW", *accelerating(10.0, 6.0, 0.0))
    slow = track(bendplatz, "07/2", "SE-NW", *accelerating(28.0, 0.0, 0.0))
    moments, refused = moments_of(scenes_of(bendplatz, [fast, slow]))
    assert list(refused) == ["scene 07/0, 3.0 s"]
    assert "overlap" in refused["scene 07/0, 3.0 s"]
    assert 3.0 not in [moment.time for moment in moments]
    assert len(moments) == 9 - 1


def test_recorded_future_is_masked_where_nothing_was_recorded(bendplatz: Intersection) -> None:
    late = track(bendplatz, "07/1", "SE-NW", *accelerating(5.0, 4.0, 0.0, 30), extrapolated=10)
    future = first(scenes_of(bendplatz, [late]))[0].recorded
    assert future.shape == (51, 1)
    np.testing.assert_array_equal(np.flatnonzero(~np.ma.getmaskarray(future)[:, 0]), np.arange(10, 30))
    assert future[20, 0] == pytest.approx(5.0 + 4.0 * 4.0)


def test_until_last_seen_scores_those_who_leave_where_they_leave(bendplatz: Intersection) -> None:
    """By hand: k steps of 0.2 s at a rate are missed by half the rate times the square of their time."""
    tracks = [
        track(bendplatz, "07/stays", "SE-NW", *accelerating(5.0, 4.0, 0.5)),
        track(bendplatz, "07/leaves after 5 s", "NW-SE", *accelerating(5.0, 4.0, 0.2, steps=26)),
        track(bendplatz, "07/after 0.8 s", "SW-NE", *accelerating(5.0, 4.0, 0.2, steps=5)),
        track(bendplatz, "07/comes later", "NE-SW", *accelerating(5.0, 4.0, 0.2), extrapolated=3),
        track(bendplatz, "07/bicycle", "NE-SW", *accelerating(30.0, 3.0, 0.2), road_user="bicycle"),
    ]
    moments, constant = first(scenes_of(bendplatz, tracks)), Predictor.load("constant_velocity")
    stays, leaves = -0.25 * 10.0**2, -0.1 * 5.0**2
    table = evaluate(constant, moments)
    rows = table.set_index(["population", "horizon"]).to_dict("index")
    everybody = rows["until_last_seen", 10.0]
    assert everybody["count"] == 2
    assert everybody["rmse"] == pytest.approx(np.sqrt((stays**2 + leaves**2) / 2.0), rel=1e-3)
    assert everybody["mad"] == pytest.approx(-(stays + leaves) / 2.0, rel=1e-3)
    assert everybody["bias"] == pytest.approx((stays + leaves) / 2.0, rel=1e-3)
    assert table[table["population"] == "last_seen"]["horizon"].tolist() == [6.0, 10.0]
    assert rows["last_seen", 6.0]["bias"] == pytest.approx(leaves, rel=1e-3)
    assert rows["last_seen", 10.0]["bias"] == pytest.approx(stays, rel=1e-3)
    figures = figures_until_last_seen(constant, moments)
    assert figures["rmse"] == pytest.approx(everybody["rmse"], abs=1e-3)
    assert figures["bias"] == pytest.approx(everybody["bias"], abs=1e-3)
    assert set(figures) == {"rmse", "mad", "bias"}  # nobody is behind the junction


def test_figure_to_choose_by_holds_those_who_leave_at_every_horizon(bendplatz: Intersection) -> None:
    """At 6, 8 and 10 s the one that left after 5 s counts as it was then."""
    tracks = [
        track(bendplatz, "07/stays", "SE-NW", *accelerating(5.0, 4.0, 0.5)),
        track(bendplatz, "07/leaves after 5 s", "NW-SE", *accelerating(5.0, 4.0, 0.2, steps=26)),
    ]
    moments, constant = first(scenes_of(bendplatz, tracks)), Predictor.load("constant_velocity")
    squares = [((0.25 * t**2) ** 2 + (0.1 * min(t, 5.0) ** 2) ** 2) / 2.0 for t in HORIZONS]
    assert distance_error(constant, moments) == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-3)
    alone = distance_error(constant, first(scenes_of(bendplatz, tracks[1:])))
    last = [(0.1 * min(t, 5.0) ** 2) ** 2 for t in HORIZONS]
    assert alone == pytest.approx(np.sqrt(np.mean(last)), rel=1e-3)


def test_speeds_behind_the_junction_are_of_whose_rear_is_there(bendplatz: Intersection) -> None:
    """One drives 8 m/s where 4 m/s is predicted, from step 3 on: each counts where it is behind itself."""
    exits = bendplatz.routes[bendplatz.route_index("SE-NW")].junction[1]
    speed = np.where(np.arange(51) < 1, 4.0, 8.0)
    position = exits + 2.25 - 3.0 + np.concatenate([[0.0], np.cumsum(STEP * speed[:-1])])
    seen = 12
    tracks = [
        track(bendplatz, "07/1", "SE-NW", position[:seen], speed[:seen]),
        track(bendplatz, "07/before", "NW-SE", *accelerating(5.0, 4.0, 0.0)),
    ]
    constant, moments = Predictor.load("constant_velocity"), first(scenes_of(bendplatz, tracks))
    found = errors(constant, moments)
    assert found.behind.compressed().tolist() == pytest.approx([4.0] * (seen - 4))  # 3.2 m after 4 steps
    assert found.recorded_behind.compressed().tolist() == pytest.approx([8.0] * (seen - 3))  # 4 m after 3 steps
    assert found.behind[:, 1].count() == 0
    figures = figures_until_last_seen(constant, moments)
    assert (figures["speed_behind"], figures["recorded_speed_behind"]) == (4.0, 8.0)


def test_bias_says_which_way_errors_lean() -> None:
    assert error_figures(np.array([-3.0, 0.0, 6.0])).bias == pytest.approx(1.0)


def test_evaluation_of_no_moments_is_refused() -> None:
    with pytest.raises(ValueError, match="no moments"):
        evaluate(Predictor.load("idm"), [])
