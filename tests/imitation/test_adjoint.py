"""The adjoint's gradients are those that torch finds step by step."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network, driving_policy, gap_network, policy_file
from agents.networks.gap import GapNetwork
from imitation.adjoint import Error, Motion, backward
from imitation.examples import recorded_examples
from imitation.joint_moments import JointMoments
from imitation.map_tables import MapTables
from imitation.torch_model import Held, Pairs, Seen, TorchPredictor
from imitation.torch_networks import Networks
from intersection_env import Predictor
from intersection_env.policies.file import PolicyFile
from tests.imitation.moments_of_places import PLACES, some_moments

TABLES = MapTables.of([place.intersection for place in PLACES])


class StepByStep(TorchPredictor):
    """The gap network's gradients as the adjoint defines them, through the steps one by one."""

    def _acceleration(self, seen: Seen, pairs: Pairs, held: Held, delta: Tensor) -> Tensor:
        acceleration = super()._acceleration(seen, pairs, held, delta)
        with torch.no_grad():
            otherwise = super()._acceleration(seen, pairs, held, ~delta) - acceleration
            gained = torch.where(delta, -otherwise, otherwise)
            gained = torch.where(pairs.told | pairs.kept | pairs.settled | pairs.stops, 0.0, gained)
        log = torch.where(held.open, logsigmoid(held.logit), 0.0)
        accepts = torch.zeros_like(acceleration).scatter_add(-1, pairs.i, log).exp()
        return acceleration + gained * (accepts - accepts.detach())


@pytest.fixture(scope="module")
def moments() -> JointMoments:
    return JointMoments.of(TABLES, recorded_examples(some_moments()))


def networks_of(name: str) -> tuple[DrivingNetwork, GapNetwork]:
    policy = Predictor.load(name).policy
    return driving_network(policy), gap_network(policy)


def error_of(moments: JointMoments, motion: Motion) -> Tensor:
    """Of all that a training's error depends on."""
    error = (motion.position - moments.position[1:]).square() + (motion.speed - moments.speed[1:]).square()
    return ((error + motion.acceleration.square()) * moments.scored[1:]).sum() / moments.scored[1:].sum()


def gradients(*networks: torch.nn.Module) -> Iterator[Tensor]:
    for network in networks:
        for weights in network.parameters():
            yield torch.zeros_like(weights) if weights.grad is None else weights.grad


@pytest.mark.parametrize("learns_gaps", [False, True])
@pytest.mark.parametrize("name", ["gail", "ppo"])
def test_gradients_are_those_of_the_steps_one_by_one(name: str, learns_gaps: bool, moments: JointMoments) -> None:
    driver, gaps = networks_of(name)
    networks = Networks(driver, gaps)
    rollout = moments.predicted(Predictor(driving_policy(policy_file(gaps, {}), driver, {}), name))
    value = backward(
        TorchPredictor(TABLES, moments.vehicles, networks),
        moments.assignment,
        rollout,
        error := partial(error_of, moments),
        error if learns_gaps else None,
    )
    ours = [one.clone() for one in gradients(driver, gaps)]
    for network in (driver, gaps):
        network.zero_grad()
    model = (StepByStep if learns_gaps else TorchPredictor)(TABLES, moments.vehicles, networks)
    states = list(model.states(moments.assignment))
    motion = Motion(*(torch.stack([getattr(one, key) for one in states]) for key in Motion._fields))
    loss = error_of(moments, motion)
    loss.backward()  # type: ignore[no-untyped-call]
    assert value == pytest.approx(float(loss.detach()), rel=1e-3)
    for one, other in zip(ours, gradients(driver, gaps), strict=True):
        scale = float(other.abs().max())
        torch.testing.assert_close(one, other, atol=0.01 * scale + 1e-9, rtol=0.0)
    assert all(bool(one.isfinite().all()) for one in ours)
    assert (float(ours[-1].abs().max()) > 0.0) == learns_gaps


def test_accepting_more_gaps_takes_drivers_further(moments: JointMoments) -> None:
    """The sign of the gap network's gradient: whoever is likelier to go is further on after 10 s."""
    driver, gaps = networks_of("gail")
    rollout = moments.predicted(Predictor.load("gail"))
    model = TorchPredictor(TABLES, moments.vehicles, Networks(driver, gaps))
    backward(model, moments.assignment, rollout, far := lambda motion: motion.position[-1].sum(), far)
    assert float(gaps.last.bias.grad) > 0.0  # type: ignore[arg-type]


def test_a_network_that_begins_has_finite_gradients(moments: JointMoments) -> None:
    driver, gaps = DrivingNetwork(), networks_of("gail")[1]
    policy: PolicyFile = driving_policy(policy_file(gaps, {}), driver, {})
    model = TorchPredictor(TABLES, moments.vehicles, Networks(driver, gaps))
    backward(
        model,
        moments.assignment,
        moments.predicted(Predictor(policy, "new")),
        error := partial(error_of, moments),
        error,
    )
    assert all(bool(one.isfinite().all()) for one in gradients(driver, gaps))
    assert max(float(one.abs().max()) for one in gradients(driver)) > 0.0


def test_driver_and_gap_network_learn_from_errors_of_their_own(moments: JointMoments) -> None:
    rollout = moments.predicted(Predictor.load("gail"))

    def both(error: Error, gap_error: Error) -> list[Tensor]:
        driver, gaps = networks_of("gail")
        model = TorchPredictor(TABLES, moments.vehicles, Networks(driver, gaps))
        backward(model, moments.assignment, rollout, error, gap_error)
        return list(gradients(driver, gaps))

    def far(motion: Motion) -> Tensor:
        return motion.position[-1].sum()

    near = partial(error_of, moments)
    mixed, same, other = both(near, far), both(near, near), both(far, far)
    of_driver = len(list(DrivingNetwork().parameters()))
    for one, wanted in zip(mixed, [*same[:of_driver], *other[of_driver:]], strict=True):
        torch.testing.assert_close(one, wanted)
    assert not torch.allclose(same[-1], other[-1])
