"""Baseline returns: the drivers are those of the core, and returns are those that the environments pay."""

from __future__ import annotations

import gymnasium
import numpy as np
import pettingzoo
import pytest
import torch

from experiments.measure.environment_returns import (
    SEED,
    Options,
    closed_loop_returns,
    driver_named,
    environment_returns,
    idm,
    main,
    replay_returns,
)
from experiments.show.environment_returns import returns_table
from intersection_env import VARIANTS, Predictor, Scenes, Traffic
from intersection_env.constants import ACCELERATION, DT
from intersection_env.evaluation.moments import moments_of
from intersection_env.features import Driving

OF = {variant.name: variant for variant in VARIANTS}


def first_step(predictor: Predictor, traffic: Traffic) -> tuple[torch.Tensor, np.ndarray]:
    """What the vehicles of a traffic see, and the accelerations of a prediction's first step."""
    found = predictor.predict(traffic)
    return torch.from_numpy(predictor.observe(traffic).driving), (found.speed[0, 1] - found.speed[0, 0]) / DT


@pytest.mark.parametrize("name", ["idm", "ppo", "rollout_gradient"])
@pytest.mark.parametrize("scenes", ["bendplatz", "crossroads"])
def test_driver_does_what_it_does_in_predictions(name: str, scenes: str) -> None:
    predictor, driver = Predictor.load(name), driver_named(name)
    moments, _ = moments_of(Scenes.load(scenes).select("development"))
    compared = 0
    for moment in moments[::10]:
        seen, wanted = first_step(predictor, moment.traffic)
        # who reaches another speed limit, or the map's end, within the step is none of the driver's doing
        did = ACCELERATION * driver(seen).numpy()
        bounded = np.clip(wanted, -ACCELERATION, ACCELERATION)
        is_car = np.isinf(moment.traffic.max_speed)
        np.testing.assert_allclose(did[is_car], bounded[is_car], atol=2e-3)
        compared += int(is_car.sum())
    assert compared > 50


def test_idm_is_held_by_its_line_and_free_without_one() -> None:
    seen = torch.zeros(2, 12)
    seen[:, Driving.DISTANCE_TO_STOP_LINE], seen[:, Driving.SPEED], seen[:, Driving.V_MAX] = 10.0, 8.0, 14.0
    seen[:, Driving.LEAD_DISTANCE], seen[:, Driving.LEAD_SPEED] = 100.0, 27.8
    seen[1, Driving.ENTERS] = 1.0
    held, free = idm(seen).tolist()
    assert held < -3.0
    assert free > 1.0


def test_closed_loop_returns_are_what_the_environment_pays() -> None:
    variant = OF["ClosedLoopShort-v0"]
    driver = driver_named("ppo")
    (rows,) = closed_loop_returns(variant, driver, 1).values()
    environment = pettingzoo.make("parallel", variant.id)
    observations, _ = environment.reset(seed=SEED)
    paid, steps = dict.fromkeys(environment.possible_agents, 0.0), 0
    while environment.agents:
        actions = driver(torch.from_numpy(np.stack(list(observations.values())))).numpy()[:, None]
        observations, rewards, *_ = environment.step(dict(zip(environment.agents, actions, strict=True)))
        paid = {agent: paid[agent] + rewards[agent] for agent in paid}
        steps += 1
    assert rows[:, 0] == pytest.approx(list(paid.values()), abs=1e-3)
    assert (rows[:, 1] == steps).all()


@pytest.mark.parametrize("name", ["ReplayShort-v0", "ReplayTJunction-v0"])
def test_replay_returns_are_what_the_environment_pays(name: str) -> None:
    driver = driver_named("idm")
    (rows,) = replay_returns(OF[name], driver, 1).values()
    environment = gymnasium.make(OF[name].id)
    observation, _ = environment.reset(seed=SEED)
    paid, steps, is_over = 0.0, 0, False
    while not is_over:
        observation, reward, terminated, truncated, _ = environment.step(
            driver(torch.from_numpy(observation))[None].numpy()
        )
        paid, steps, is_over = paid + float(reward), steps + 1, terminated or truncated
    assert rows.tolist() == [[pytest.approx(paid, abs=1e-3), steps]]


def test_every_variant_and_driver_has_its_return_in_the_table() -> None:
    results = environment_returns(Options(drivers=("random", "idm"), worlds=2, episodes=3))
    assert list(results["variants"]) == list(OF)
    lines = returns_table(results).splitlines()
    assert lines[0] == "| environment | random | idm |"
    assert len(lines) == 2 + len(VARIANTS)
    for found in results["variants"].values():
        assert found["idm"]["return"]["value"] > found["random"]["return"]["value"]


def test_driver_that_is_none_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(Options(drivers=("nobody",))) == 1
    assert 'no policy "nobody"' in capsys.readouterr().err
    assert main(Options(drivers=("idm_calibrated",))) == 1
    assert 'the policy "idm_calibrated" has no driving network' in capsys.readouterr().err
