"""Drivers who keep their patience, as a model and as draws."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.models.patient import drawn_yielder_first, patient
from intersection_env import Intersection, Predictor, Traffic, Vehicle
from tests.support.busy_traffic import busy

BENDPLATZ = Intersection.load("bendplatz")


def one_pair(before: float) -> Traffic:
    """The yielder comes to its line; the other is so far before its own."""
    own, other = (BENDPLATZ.routes[BENDPLATZ.route_index(name)].stop_line for name in ("SW-NE", "SE-NW"))
    vehicles = [Vehicle("waits", "SW-NE", own - 15.0, 6.0), Vehicle("comes", "SE-NW", other - before, 11.0)]
    return Traffic.of(BENDPLATZ, vehicles)


def test_the_patient_one_keeps_its_patience_under_a_name_of_its_own() -> None:
    one = patient(Predictor.load("gap"))
    assert (one.name, one.patience) == ("gap_patience_kept", "kept")
    with pytest.raises(ValueError, match="drivers have no quantiles"):
        patient(Predictor.load("idm"))


def test_draws_repeat_and_say_what_is_sure_where_it_is() -> None:
    predictor, traffic = Predictor.load("gap"), busy()
    one, two = (drawn_yielder_first(predictor, traffic, draws=8, seed=3) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert ((one >= 0.5 / 9.0) & (one <= 8.5 / 9.0)).all()
    assert len(np.unique(one)) > 2


def test_the_farther_the_other_is_the_more_drivers_go_first() -> None:
    predictor = Predictor.load("gap")
    chances = [float(drawn_yielder_first(predictor, one_pair(before), draws=16)[0]) for before in (5.0, 90.0)]
    assert chances[0] < 0.1
    assert chances[0] < chances[1]
