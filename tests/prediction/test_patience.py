"""Patience that is kept: chained, the same from every kernel, and refused where there are no quantiles."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from intersection_env import Intersection, Predictor, Traffic, Vehicle, _core, forecast
from intersection_env.constants import STEPS
from intersection_env.scenes.scenes import Scenes
from tests.core.test_twin_patience import standing_case
from tests.support.busy_traffic import T, busy

BENDPLATZ = Intersection.load("bendplatz")


def waiting_at_a_line() -> Traffic:
    """The gap network would have the first one go, though it stands."""
    line = BENDPLATZ.routes[BENDPLATZ.route_index("SW-NE")].stop_line
    vehicles = [Vehicle("waits", "SW-NE", line - 3.0, 0.0), Vehicle("comes", "SE-NW", 20.0, 11.0)]
    return Traffic.of(BENDPLATZ, vehicles)


def test_who_waits_lets_pass_what_it_has_refused() -> None:
    traffic = waiting_at_a_line()
    anew, kept = (Predictor.load("gap", patience=one).predict(traffic) for one in ("none", "kept"))
    assert anew.enters[0, 0].tolist() == [True, True]
    assert kept.enters[0, 0].tolist() == [False, True]
    assert kept.patience is not None
    assert kept.patience[0] > 0.0
    assert kept.patience[1] == 0.0
    assert anew.patience is None


def test_no_patience_is_the_default_and_the_median_of_those_who_drive() -> None:
    assert Predictor.load("gap").patience == "none"
    moving = replace(busy(), speed=np.maximum(busy().speed, np.float32(0.2)))
    one, other = (Predictor.load("gap", patience=how).predict(moving) for how in ("none", "kept"))
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(other.patience, np.zeros(len(moving)))


@pytest.mark.parametrize("policy", ["gap", "rollout_gradient"])
@pytest.mark.parametrize("drawn", [False, True])
def test_chained_patience_is_one_patience(policy: str, drawn: bool) -> None:
    predictor, kept = Predictor.load(policy, patience="kept"), 0
    for seed in range(20):
        traffic, _ = standing_case("bendplatz", 72_000 + seed)
        if drawn:
            levels = np.random.default_rng(seed).uniform(0.01, 0.99, len(traffic))
            traffic = replace(traffic, patience=predictor.patience_of(traffic, levels))
        whole = predictor.predict(traffic)
        assert whole.patience is not None
        kept += int(np.count_nonzero(whole.patience))
        for step in (0, 1, 7, 30):
            later = predictor.predict(whole.traffic_at(float(whole.time[step])))
            on = whole.present[0, step]
            np.testing.assert_array_equal(later.patience, whole.patience[on])
            for name in ("position", "speed", "enters", "hold"):
                ours, theirs = getattr(later, name)[0, : STEPS - step], getattr(whole, name)[0, step:STEPS, on].T
                np.testing.assert_array_equal(ours, theirs, err_msg=name)
    assert kept > 10


@pytest.mark.parametrize("isa", _core.available_kernels())
def test_a_block_and_single_scenarios_keep_the_same_patience(isa: str) -> None:
    predictor = Predictor.load("gap", patience="kept")
    best = _core.available_kernels()[-1]
    for seed in range(10):
        traffic, _ = standing_case("bendplatz", 73_000 + seed)
        core = predictor.bound_to(traffic.intersection)
        rows = np.zeros((17, len(traffic.conflicts)), np.int8)
        block, one = (core.predict(traffic.core, some, True, True, None, isa) for some in (rows, rows[:1]))
        for many, single in zip(block[:-1], one[:-1], strict=True):
            np.testing.assert_array_equal(np.asarray(many)[[0, 16]], np.repeat(np.asarray(single), 2, axis=0))
        if isa != "baseline":  # which fuses no multiply-adds
            np.testing.assert_array_equal(block[-1], core.predict(traffic.core, rows, False, False, None, best)[-1])


def test_a_higher_level_is_more_patient() -> None:
    traffic, predictor = waiting_at_a_line(), Predictor.load("gap")
    levels = np.linspace(0.05, 0.95, 10)
    kept = np.stack([predictor.patience_of(traffic, one) for one in levels])
    assert (np.diff(kept, axis=0) > 0.0).all()
    logit = float(predictor.core_policy.evaluate_gap(predictor.observe(traffic).gap)[0])
    assert (kept[:, 0] > logit).all(), "who waits has refused"


def test_patience_survives_pickling_and_copying_and_a_predictor_too() -> None:
    traffic = Predictor.load("gap", patience="kept").predict(waiting_at_a_line()).traffic_at(1.0)
    assert traffic.patience is not None
    for other in (pickle.loads(pickle.dumps(traffic)), copy.deepcopy(traffic)):
        np.testing.assert_array_equal(other.patience, traffic.patience)
    for how in ("none", "kept"):
        assert pickle.loads(pickle.dumps(Predictor.load("gap", patience=how))).patience == how


def test_an_order_leaves_nothing_to_patience() -> None:
    traffic = waiting_at_a_line()
    ways = [Predictor.load("gap", patience=how).predict(traffic, [("waits", "comes")]) for how in ("none", "kept")]
    np.testing.assert_array_equal(ways[0].position, ways[1].position)
    chosen = forecast(Predictor.load("gap", patience="kept"), traffic)
    assert chosen.most_probable().traffic_at(1.0).patience is not None


def test_recorded_traffic_has_no_patience() -> None:
    scenes = Scenes.load("bendplatz")
    assert scenes.at(scenes[0], 0.0).patience is None


def test_patience_is_refused_where_no_network_decides() -> None:
    with pytest.raises(ValueError, match='in "idm" critical_gap decides about gaps, not a network, so drivers have no'):
        Predictor.load("idm", patience="kept")
    with pytest.raises(ValueError, match='in "constant_velocity" sumo decides about gaps'):
        Predictor.load("constant_velocity", gap="sumo", patience="kept")
    with pytest.raises(ValueError, match="only where a network decides about gaps are drivers more or less patient"):
        Predictor.load("idm").patience_of(busy())
    with pytest.raises(ValueError, match="this traffic's drivers keep patience, but no network decides about gaps"):
        Predictor.load("idm").predict(replace(busy(), patience=np.zeros(len(busy()), np.float32)))
    assert Predictor.load("idm").patience == Predictor.load("idm", patience="none").patience == "none"


def test_another_patience_is_refused() -> None:
    with pytest.raises(ValueError, match=r'patience must be "none", "kept" or None, not .median.'):
        Predictor.load("gap", patience="median")  # type: ignore[arg-type]


@pytest.mark.parametrize("level", [0.0, 1.0, -0.1, float("nan")])
def test_a_level_out_of_range_is_refused(level: float) -> None:
    with pytest.raises(ValueError, match="a level must be above 0 and below 1, not"):
        Predictor.load("gap").patience_of(busy(), level)


@pytest.mark.parametrize(
    ("patience", "error", "message"),
    [
        (np.zeros(2), TypeError, "patience must be an array of float32, not float64"),
        (np.zeros(1, np.float32), ValueError, r"patience must have shape \(2,\), one entry an id, not \(1,\)"),
        (np.array([0, np.nan], np.float32), ValueError, "vehicle y: patience must be finite, not nan"),
        (np.array([np.inf, 0], np.float32), ValueError, "vehicle x: patience must be finite, not inf"),
    ],
)
def test_malformed_patience_is_refused(patience: Any, error: type[Exception], message: str) -> None:
    traffic = Traffic.of(T, [Vehicle("x", "W-E", 50, 5), Vehicle("y", "W-E", 100, 5)])
    with pytest.raises(error, match=message):
        replace(traffic, patience=patience)


def test_levels_that_are_not_one_a_vehicle_are_refused() -> None:
    traffic = busy()
    with pytest.raises(ValueError, match=rf"levels must be one number or have shape \({len(traffic)},\), not \(2,\)"):
        Predictor.load("gap").patience_of(traffic, [0.5, 0.5])
