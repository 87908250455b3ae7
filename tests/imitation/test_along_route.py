"""What a run has learned along a route: the table says what the networks do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.training.folder import CHECKPOINT, RunFolder
from imitation.along_route import PLACES, SPEEDS, Options, along_route
from imitation.empty_road_states import LENGTHS, Car, seen_alone
from imitation.gail import train_driver
from intersection_env import Intersection
from intersection_env.constants import ACCELERATION
from tests.support.scenes import small_scenes
from tests.support.trainings import TINY_GAIL


def test_table_shows_the_last_networks_by_place_and_speed(tmp_path: Path) -> None:
    folder = RunFolder.begin(tmp_path / "run", {}, "", False)
    train_driver(small_scenes("train", "development"), None, replace(TINY_GAIL, epochs=2), folder, progress=False)
    head, *lines = along_route(Options(tmp_path / "run")).splitlines()
    assert len(lines) == len(PLACES)
    assert head.count("m/s") == len(SPEEDS)
    map_, policy = Intersection.load("t_junction"), DrivingNetwork()
    state = torch.load(tmp_path / "run" / CHECKPOINT)["driver"]
    policy.load_state_dict({name[7:]: value for name, value in state.items() if name.startswith("policy.")})
    route = map_.routes[map_.route_index("W-S")]
    car = Car(route.index, route.stop_line + PLACES[2], SPEEDS[1], sum(LENGTHS) / 2)
    does = float(ACCELERATION * torch.tanh(policy(torch.from_numpy(seen_alone(map_, [car])))).detach())
    assert float(lines[2].split("|")[2].split()[0]) == pytest.approx(does, abs=0.01)


def test_missing_run_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        along_route(Options(tmp_path))
