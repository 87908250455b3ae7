"""Who stands across the path leads in `AcrossPredictor`, and nothing else differs from the core."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from experiments.models.lead_across import AcrossPredictor, TorchForecaster
from imitation.torch_model import TorchPredictor
from intersection_env import Intersection, Predictor, Traffic
from intersection_env.evaluation.moments import moments_of
from intersection_env.policies.file import PolicyFile
from intersection_env.traffic import Vehicle
from tests.support.scenes import small_scenes


@pytest.fixture(scope="module")
def policy() -> PolicyFile:
    return Predictor.load("gail").policy


def crossing(speed: float, before: float, *others: Vehicle) -> Traffic:
    """A vehicle so far [m] before a conflict, and one upon it with this speed."""
    bendplatz = Intersection.load("bendplatz")
    names = [route.id for route in bendplatz.routes]
    conflict = next(one for one in bendplatz.conflicts if not one.merging and names[one.prioritized] == "SE-NW")
    begin, other_begin = conflict.on_yielder[0], conflict.on_prioritized[0]
    comes = Vehicle("comes", names[conflict.prioritized], other_begin - before - 2.25, 10.0)
    stands = Vehicle("stands", names[conflict.yielder], begin + 1.0, speed)
    return Traffic.of(bendplatz, [comes, stands, *others])


def leads(model: type[TorchPredictor], traffic: Traffic, policy: PolicyFile) -> tuple[Tensor, Tensor, Tensor]:
    """Lead, distance and its speed of each vehicle now."""
    bound = model.of(traffic, policy)
    position, speed, half = bound.vehicles.position, bound.vehicles.speed, bound.vehicles.half_length
    lead, _, distance, lead_speed = bound._leads(
        position, position + half, position - half, speed, bound.vehicles.present
    )
    return lead[0], distance[0], lead_speed[0]


def test_who_stands_on_the_conflict_leads(policy: PolicyFile) -> None:
    traffic = crossing(0.5, 20.0)
    lead, distance, speed = leads(AcrossPredictor, traffic, policy)
    assert (int(lead[0]), float(speed[0])) == (1, 0.5)
    assert float(distance[0]) == pytest.approx(20.0, abs=1e-3)
    assert float(leads(TorchPredictor, traffic, policy)[1][0]) == 100.0


@pytest.mark.parametrize(("speed", "before"), [(1.5, 20.0), (0.5, -0.5), (0.5, 120.0)], ids=["moves", "past", "far"])
def test_others_do_not(policy: PolicyFile, speed: float, before: float) -> None:
    traffic = crossing(speed, before)
    for ours, theirs in zip(
        leads(AcrossPredictor, traffic, policy), leads(TorchPredictor, traffic, policy), strict=True
    ):
        torch.testing.assert_close(ours[0], theirs[0])


def test_the_nearer_one_leads(policy: PolicyFile) -> None:
    traffic = crossing(0.5, 20.0)
    ahead = Vehicle("ahead", "SE-NW", float(traffic.position[0]) + 10.0, 3.0)
    lead, distance, speed = leads(AcrossPredictor, crossing(0.5, 20.0, ahead), policy)
    assert (int(lead[0]), float(speed[0])) == (2, 3.0)
    assert float(distance[0]) == pytest.approx(5.5, abs=1e-3)


def test_it_brakes_for_who_stands_there(policy: PolicyFile) -> None:
    traffic = crossing(0.0, 15.0)
    after = [TorchForecaster("", policy, model).predict(traffic) for model in (TorchPredictor, AcrossPredictor)]
    free, behind = (float(one.position[0, 10, 0]) for one in after)
    assert behind < free - 1.0


def test_without_it_predictions_are_those_of_the_core(policy: PolicyFile) -> None:
    forecaster, core = TorchForecaster("", policy, TorchPredictor), Predictor(policy, "core")
    moments = moments_of(small_scenes("development"))[0][::30]
    assert len(moments) >= 3
    for moment in moments:
        ours, theirs = forecaster.predict(moment.traffic), core.predict(moment.traffic)
        np.testing.assert_array_equal(ours.present, theirs.present)
        for name in ("position", "speed", "time_loss", "minimum_distance"):
            np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=2e-3, err_msg=name)
