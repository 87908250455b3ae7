"""Moments side by side are predicted each as if alone, and held to what became of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from imitation.examples import recorded_examples
from imitation.joint_moments import JointMoments
from imitation.map_tables import MapTables
from imitation.torch_model import TorchPredictor
from imitation.torch_networks import Networks
from intersection_env import Predictor
from intersection_env.evaluation.moments import Moment
from tests.imitation.moments_of_places import PLACES, some_moments

TOLERANCE = 2e-3  # [m], [m/s]


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    return some_moments()


@pytest.fixture(scope="module")
def found(moments: list[Moment]) -> JointMoments:
    return JointMoments.of(MapTables.of([place.intersection for place in PLACES]), recorded_examples(moments))


def test_the_core_predicts_each_moment(moments: list[Moment], found: JointMoments) -> None:
    predictor = Predictor.load("gail")
    rollout = found.predicted(predictor)
    for row, moment in enumerate(moments):
        wanted, count = predictor.predict(moment.traffic), len(moment.traffic)
        for name in ("position", "speed", "enters", "present"):
            np.testing.assert_array_equal(getattr(rollout, name)[:, row, :count].numpy(), getattr(wanted, name)[0])
        assert not bool(rollout.present[:, row, count:].any())


def test_in_torch_moments_side_by_side_are_predicted_as_by_the_core(found: JointMoments) -> None:
    tables = MapTables.of([place.intersection for place in PLACES])
    predictor = Predictor.load("gail")
    model = TorchPredictor(tables, found.vehicles, Networks.of(predictor.policy))
    with torch.no_grad():
        states = list(model.states(found.assignment))
    core = found.predicted(predictor)
    for name in ("position", "speed"):
        ours, theirs = torch.stack([getattr(one, name) for one in states]), getattr(core, name)[1:]
        torch.testing.assert_close(ours, theirs, atol=TOLERANCE, rtol=0.0)


def test_some_rows_are_those_moments_and_no_wider_than_they_need(found: JointMoments) -> None:
    chosen = torch.tensor([5, 1, 12])
    some = found.rows(chosen)
    assert some.position.shape[2] == int(some.width.max()) + 1
    predictor = Predictor.load("gail")
    ours, theirs = some.predicted(predictor), found.predicted(predictor)
    networks, tables = Networks.of(predictor.policy), MapTables.of([place.intersection for place in PLACES])
    with torch.no_grad():
        *_, last = TorchPredictor(tables, some.vehicles, networks).states(some.assignment)
    for row, at in enumerate(chosen.tolist()):
        count = int(some.width[row])
        torch.testing.assert_close(ours.position[:, row, :count], theirs.position[:, at, :count])
        torch.testing.assert_close(some.position[:, row, :count], found.position[:, at, :count])
        torch.testing.assert_close(last.position[row, :count], ours.position[-1, row, :count], atol=TOLERANCE, rtol=0.0)


def test_what_became_of_them_stands_beside(moments: list[Moment], found: JointMoments) -> None:
    for row, moment in enumerate(moments):
        count = len(moment.traffic)
        np.testing.assert_array_equal(found.position[:, row, :count].numpy(), moment.recorded.data)
        np.testing.assert_array_equal(found.scored[:, row, :count].numpy(), moment.scored & moment.scored[0])
        np.testing.assert_allclose(found.speed[0, row, :count].numpy(), moment.traffic.speed)
        assert not bool(found.scored[:, row, count:].any())
