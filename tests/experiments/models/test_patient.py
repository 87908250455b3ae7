"""Drivers who keep their patience, as a model and as draws."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.models.patient import drawn_yielder_first, patient
from intersection_env import Intersection, Predictor, Traffic, Vehicle
from tests.support.busy_traffic import busy

BENDPLATZ = Intersection.load("bendplatz")


def one_pair(before: float, speed: float) -> Traffic:
    """The yielder is at its line or drives up to it; the other is so far before its own."""
    own, other = (BENDPLATZ.routes[BENDPLATZ.route_index(name)].stop_line for name in ("SW-NE", "SE-NW"))
    vehicles = [
        Vehicle("yields", "SW-NE", own - 3.0 - 3.0 * speed, speed),
        Vehicle("comes", "SE-NW", other - before, 11.0),
    ]
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


def test_who_has_refused_one_foe_lets_it_pass_and_who_drives_up_goes_the_likelier_the_farther_it_is() -> None:
    predictor = Predictor.load("gap")
    for before in (25.0, 60.0):
        assert drawn_yielder_first(predictor, one_pair(before, 0.0), draws=16) == pytest.approx([0.5 / 17.0])
    near, far = (float(drawn_yielder_first(predictor, one_pair(one, 3.0), draws=16)[0]) for one in (25.0, 80.0))
    assert near < 0.2
    assert near < far
