"""Drives for gradients: they begin where recorded ones do, see what these saw, and move as predictions do."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_network
from imitation.adjoint import Motion
from imitation.drives import free_drives, joined, recorded_drives
from imitation.examples import free_examples
from imitation.expert import expert_steps
from imitation.map_tables import MapTables
from imitation.torch_networks import Networks, View
from intersection_env import Predictor, Scenes, Traffic
from intersection_env.constants import ACCELERATION, DT, STEPS
from intersection_env.traffic import Vehicle
from tests.support.scenes import small_scenes

ALL_STEPS = DT  # [s], between the starts


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return small_scenes("train", each=2)


@pytest.fixture(scope="module")
def tables(scenes: Scenes) -> MapTables:
    return MapTables.of([scenes.intersection])


class Watching(DrivingNetwork):
    """Does nothing, and keeps what it saw."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[Tensor] = []

    def forward(self, features: Tensor) -> Tensor:
        self.seen.append(features)
        return torch.zeros(features.shape[:-1])


def networks(driving: DrivingNetwork) -> Networks:
    return Networks(driving, gap=driving)  # nobody asks about gaps


def test_at_its_start_a_drive_sees_what_the_recorded_driver_saw(scenes: Scenes, tables: MapTables) -> None:
    drives, expert = recorded_drives(tables, [scenes], "train", ALL_STEPS), expert_steps(scenes, "train")
    watching = Watching()
    drives.driven(tables, networks(watching), steps=1)
    counts = np.unique(expert.track, return_counts=True)[1]
    within = np.concatenate([np.arange(count) < count - 5 for count in counts])
    np.testing.assert_allclose(watching.seen[0].numpy(), expert.observation[within], atol=2e-3)


def test_a_drive_goes_on_as_it_was_recorded_until_its_track_ends(scenes: Scenes, tables: MapTables) -> None:
    drives, expert = recorded_drives(tables, [scenes], "train", 1.0), expert_steps(scenes, "train")
    place = tables.stop_line[drives.route] - drives.half_length
    for row in (0, 7, len(drives.route) - 1):
        known = int(drives.known[row].sum())
        to_line = (place[row] - drives.position[row, :known]).numpy()
        found = [k for k in range(len(expert) - known + 1) if np.allclose(expert.observation[k, 0], to_line[0])]
        assert any(np.allclose(expert.observation[k : k + known, 0], to_line, atol=1e-3) for k in found)
        assert known >= 6


def test_starts_are_so_far_apart_and_no_drive_is_too_short(scenes: Scenes, tables: MapTables) -> None:
    every, seldom = (recorded_drives(tables, [scenes], "train", apart) for apart in (1.0, 4.0))
    assert 3.0 < len(every.route) / len(seldom.route) < 4.5
    assert every.known.sum(1).min() >= 6
    assert every.known[:, 0].all()
    assert bool((every.known.int().diff(dim=1) <= 0).all()), "a drive that has ended is known again"


@pytest.mark.parametrize("name", ["gail", "ppo"])
def test_whoever_drives_alone_moves_as_the_core_predicts(name: str, scenes: Scenes, tables: MapTables) -> None:
    """The same network, from the same starts: it drives here as it does there."""
    predictor = Predictor.load(name)
    examples = free_examples([scenes], Predictor.load("idm_calibrated"), 40, np.random.default_rng(0))
    with torch.no_grad():
        motion = free_drives(tables, examples).driven(tables, networks(driving_network(predictor.policy)), STEPS)
    for row, one in enumerate(examples):
        core = predictor.predict(one.traffic)
        known = core.present[0, :-1, 0]
        ours = motion.position[:, row].numpy()[known], motion.speed[:, row].numpy()[known]
        np.testing.assert_allclose(ours[0], core.position[0, 1:, 0][known], atol=2e-3)
        np.testing.assert_allclose(ours[1], core.speed[0, 1:, 0][known], atol=2e-3)


def test_behind_a_standing_lead_it_stops(scenes: Scenes, tables: MapTables) -> None:
    """The limits of a prediction hold: a driver that only accelerates stops before the rear bumper ahead."""
    alone = free_examples([scenes], Predictor.load("idm_calibrated"), 1, np.random.default_rng(0))
    begin = free_drives(tables, alone)
    rear = 40.0 + torch.zeros_like(begin.position)
    start = begin._replace(position=torch.zeros_like(rear), lead_rear=rear, lead_speed=torch.zeros_like(rear))

    class Faster(DrivingNetwork):
        def forward(self, features: Tensor) -> Tensor:
            return torch.full(features.shape[:-1], 3.0)

    motion = start.driven(tables, networks(Faster()), STEPS)
    gap = rear[0, 0] - motion.position[-1, 0] - start.half_length[0]
    assert 0.4 < float(gap) < 1.5
    assert float(motion.speed[-1, 0]) < 0.2


def test_gradients_reach_the_driver_and_are_finite(scenes: Scenes, tables: MapTables) -> None:
    drives = recorded_drives(tables, [scenes], "train", 4.0)
    driver = DrivingNetwork()
    motion = drives.driven(tables, networks(driver), STEPS)
    ((motion.position.T - drives.position[:, 1:]) * drives.known[:, 1:]).square().mean().backward()  # type: ignore[no-untyped-call]
    for weights in driver.parameters():
        assert weights.grad is not None
        assert bool(weights.grad.isfinite().all())
        assert float(weights.grad.abs().max()) > 0.0


def test_noise_reaches_the_network_and_not_the_limits(scenes: Scenes, tables: MapTables) -> None:
    drives = recorded_drives(tables, [scenes], "train", 4.0)
    watching = Watching()
    noise = torch.randn((1, len(drives.route), 12), generator=torch.Generator().manual_seed(0))
    drives.driven(tables, networks(watching), 1)
    drives.driven(tables, networks(watching), 1, noise)
    torch.testing.assert_close(watching.seen[1] - watching.seen[0], noise[0], atol=1e-4, rtol=1e-4)


def test_views_and_features_are_the_same_in_another_form(scenes: Scenes) -> None:
    seen = torch.from_numpy(expert_steps(scenes, "train").observation)
    view, delta = View.of(seen)
    torch.testing.assert_close(view.features(delta), seen)
    moment = Traffic.of(scenes.intersection, [Vehicle("a", "SE-NW", 20.0, 8.0)])
    predictor = Predictor.load("gail")
    view, delta = View.of(torch.from_numpy(predictor.observe(moment).driving))
    with torch.no_grad():
        wanted = networks(driving_network(predictor.policy)).drive(view, delta)
    assert float(wanted[0]) == pytest.approx(float(predictor.predict(moment).acceleration[0, 0, 0]), abs=1e-4)
    assert abs(float(wanted[0])) <= ACCELERATION


@pytest.mark.parametrize("name", ["gail", "ppo"])
@pytest.mark.parametrize("noisy", [False, True])
def test_gradients_are_those_of_the_steps_one_by_one(name: str, noisy: bool, scenes: Scenes, tables: MapTables) -> None:
    generator = torch.Generator().manual_seed(0)
    examples = free_examples([scenes], Predictor.load("idm_calibrated"), 40, np.random.default_rng(0))
    drives = joined(recorded_drives(tables, [scenes], "train", 2.0), free_drives(tables, examples))
    noise = 0.1 * torch.randn((STEPS, len(drives.route), 12), generator=generator) if noisy else None

    def error(motion: Motion) -> Tensor:
        """Of all that a training's error depends on."""
        far = (motion.position - drives.position.T[1:]).square() + (motion.speed - drives.speed.T[1:]).square()
        return ((far + motion.acceleration.square()) * drives.known.T[1:]).sum() / drives.known.sum()

    driver = driving_network(Predictor.load(name).policy)
    value = drives.backward(tables, networks(driver), STEPS, error, noise)
    ours = [weights.grad for weights in driver.parameters()]
    driver.zero_grad()
    wanted = error(drives.driven(tables, networks(driver), STEPS, noise))
    wanted.backward()  # type: ignore[no-untyped-call]
    assert value == pytest.approx(float(wanted.detach()))
    for one, weights in zip(ours, driver.parameters(), strict=True):
        assert one is not None
        assert weights.grad is not None
        scale = float(weights.grad.abs().max())
        assert scale > 0.0
        torch.testing.assert_close(one, weights.grad, atol=1e-3 * scale, rtol=0.0)
