"""Moments predicted side by side, with gradients: each as if it were alone, and held to what was recorded."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network, gap_network
from imitation.examples import recorded_examples
from imitation.joint_moments import JointMoments
from imitation.map_tables import MapTables
from imitation.torch_networks import Networks
from intersection_env import Predictor
from intersection_env.evaluation.moments import Moment, contested
from intersection_env.evaluation.places import moments_in
from intersection_env.scenes.places import ALL_SCENES, load_places

TOLERANCE = 2e-3  # [m], [m/s]
PLACES = load_places(ALL_SCENES)


@pytest.fixture(scope="module")
def moments() -> list[Moment]:
    """Of all places, of unlike sizes, most of them contested."""
    every = [moments_in(place, "development", 20.0)[0] for place in PLACES]
    return [one for own in every for one in (*contested(own)[:6], own[0])]


@pytest.fixture(scope="module")
def tables() -> MapTables:
    return MapTables.of([place.intersection for place in PLACES])


@pytest.fixture(scope="module")
def networks() -> Networks:
    policy = Predictor.load("gail").policy
    return Networks(driving_network(policy), gap_network(policy))


def test_each_moment_is_predicted_as_by_the_core(moments: list[Moment], tables: MapTables, networks: Networks) -> None:
    with torch.no_grad():
        motion = JointMoments.of(tables, recorded_examples(moments)).driven(tables, networks, learns_gaps=True)
    predictor = Predictor.load("gail")
    for row, moment in enumerate(moments):
        core, count = predictor.predict(moment.traffic), len(moment.traffic)
        for name in ("position", "speed"):
            ours = getattr(motion, name)[row, :, :count].numpy()
            np.testing.assert_allclose(ours, getattr(core, name)[0, 1:], atol=TOLERANCE, err_msg=name)


def test_some_rows_are_predicted_as_all_are(moments: list[Moment], tables: MapTables, networks: Networks) -> None:
    every = JointMoments.of(tables, recorded_examples(moments))
    chosen = torch.tensor([5, 1, 12])
    some = every.rows(chosen)
    assert some.position.shape[2] == int(some.width.max()) + 1
    with torch.no_grad():
        ours, theirs = (one.driven(tables, networks, False).position for one in (some, every))
    for row, at in enumerate(chosen.tolist()):
        count = int(some.width[row])
        torch.testing.assert_close(ours[row, :, :count], theirs[at, :, :count], atol=TOLERANCE, rtol=0.0)
        torch.testing.assert_close(some.position[row, :, :count], every.position[at, :, :count])


def test_what_was_recorded_stands_beside_and_only_cars_and_trucks_count(
    moments: list[Moment], tables: MapTables
) -> None:
    found = JointMoments.of(tables, recorded_examples(moments))
    for row, moment in enumerate(moments):
        count = len(moment.traffic)
        np.testing.assert_array_equal(found.position[row, :, :count].numpy(), moment.recorded.data)
        np.testing.assert_array_equal(found.scored[row, :, :count].numpy(), moment.scored & moment.scored[0])
        np.testing.assert_allclose(found.speed[row, 0, :count].numpy(), moment.traffic.speed)
        assert not bool(found.scored[row, :, count:].any())


def gradients(moments: list[Moment], tables: MapTables, learns_gaps: bool) -> tuple[torch.Tensor, list[torch.Tensor]]:
    """The positions after 10 s, and the gap network's gradients of their sum."""
    policy = Predictor.load("gail").policy
    gaps = gap_network(policy)
    motion = JointMoments.of(tables, recorded_examples(moments)).driven(
        tables, Networks(driving_network(policy), gaps), learns_gaps=learns_gaps
    )
    motion.position[:, -1].sum().backward()  # type: ignore[no-untyped-call]
    return motion.position.detach(), [one.grad for one in gaps.parameters() if one.grad is not None]


def test_the_gap_network_learns_without_a_change_of_the_prediction(moments: list[Moment], tables: MapTables) -> None:
    fixed, none = gradients(moments, tables, learns_gaps=False)
    learned, some = gradients(moments, tables, learns_gaps=True)
    torch.testing.assert_close(learned, fixed, atol=1e-3, rtol=0.0)
    assert all(float(one.abs().max()) == 0.0 for one in none)
    assert all(bool(one.isfinite().all()) for one in some)
    assert max(float(one.abs().max()) for one in some) > 0.0


def test_accepting_more_gaps_takes_drivers_further(moments: list[Moment], tables: MapTables) -> None:
    """The sign of the gradient: whoever is likelier to go is further on after 10 s."""
    _, some = gradients(moments, tables, learns_gaps=True)
    assert float(some[-1]) > 0.0  # of the last layer's bias, which raises every logit


def test_gradients_reach_the_driver_and_are_finite(moments: list[Moment], tables: MapTables) -> None:
    driver, gaps = DrivingNetwork(), gap_network(Predictor.load("gail").policy)
    found = JointMoments.of(tables, recorded_examples(moments))
    motion = found.driven(tables, Networks(driver, gaps), learns_gaps=True)
    ((motion.position - found.position[:, 1:]) * found.scored[:, 1:]).square().mean().backward()  # type: ignore[no-untyped-call]
    for weights in driver.parameters():
        assert weights.grad is not None
        assert bool(weights.grad.isfinite().all())
        assert float(weights.grad.abs().max()) > 0.0
