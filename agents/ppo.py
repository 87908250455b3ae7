"""Trains the driver by PPO: every vehicle of the closed loop acts, with policy and value networks shared.

python -m agents.ppo fast --run runs/ppo
python -m agents.ppo fast --map mine.json --run runs/mine
python -m agents.ppo paper --run runs/ppo_paper
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import torch
import tyro
from tensordict import TensorDict

from agents.networks.driving import Driver, DrivingNetwork
from agents.networks.export import driving_policy, gap_hash
from agents.rollouts.envs import ClosedLoopEnv
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.rollouts.validation_run import ValidationRun, validation_run
from agents.rollouts.workers import rollout_collector, shares
from agents.training.command import Command
from agents.training.folder import RunFolder, decisive
from agents.training.loop import Epochs, geometric, linear
from agents.training.options import Seeds
from agents.training.seeds import train_seeds
from intersection_env.command import run_command
from intersection_env.constants import DT
from intersection_env.evaluation.empty_road import EmptyRoad, empty_road
from intersection_env.features import Driving
from intersection_env.maps.intersection import Intersection, recorded_maps
from intersection_env.policies.named import gap_decider
from intersection_env.prediction.predictor import Predictor

COMMAND = "python -m agents.ppo"
VALIDATION_SEED = 2**40  # of no training
WATCHED_WORLDS, WATCHED_STEPS = 16, 1000  # at each checkpoint


@dataclass(frozen=True)
class PpoSettings:
    """What a training of the driver by PPO depends on."""

    run: Path = Path("runs/ppo")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    map: tuple[str, ...] = recorded_maps()
    """Names or files of maps, each in an equal share of the worlds."""
    gaps: tuple[str, ...] = ("gap", "critical_gap")
    """Who decides about gaps, each in an equal share of each map's worlds: policies with a gap network (name or file),
    critical_gap or sumo. The first one also decides in the policy that is written."""
    worlds: int = 256
    """On all maps; shares differ by one where they cannot be equal."""
    vehicles: int = 12
    """In each world; paper, Section IV-B.2."""
    steps: int = 128
    """Of each world in an epoch."""
    epochs: int = 300
    learning_rate: float = 1e-2
    last_learning_rate: float = 1e-4
    """Fallen to linearly."""
    sigma: float = 0.3
    """Deviation of the action before its tanh."""
    last_sigma: float = 0.1
    """Fallen to geometrically."""
    least_reward: float = -3000.0
    """Rewards below it count as this."""
    reward_scale: float = 0.05
    """Rewards are multiplied by it."""
    update: UpdateSettings = field(default_factory=lambda: UpdateSettings(passes=1, minibatches=32))
    seed: int = 0
    threads: int = 0
    """That step the worlds, 0: one a core; they do not change what comes out."""
    workers: int = 0
    """Ray workers that share the worlds, on one machine or several, 0: none; they do not change what comes out."""
    seeds: Seeds = ()
    """Train once with each of these instead of `seed`, side by side as Ray tasks, in the folders RUN/seed_0, ..."""
    tensorboard: bool = False
    """Write the figures for TensorBoard too, into the run folder."""
    checkpoint_every: int = 50
    """Epochs."""


PROFILES = {
    "fast": ("in minutes on two cores", PpoSettings()),
    "paper": (
        "the paper's Table III; for weeks",
        PpoSettings(
            map=("bendplatz",),
            gaps=("gap",),
            worlds=1,
            steps=2000,
            epochs=1_000_000,
            learning_rate=2e-5,
            last_learning_rate=2e-5,
            last_sigma=0.3,
            least_reward=-6000.0,
            update=UpdateSettings(minibatches=12),
        ),
    ),
}


def train_driver(settings: PpoSettings, folder: RunFolder | None = None, progress: bool = True) -> Driver:
    """The trained driver.

    Args:
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C or SIGTERM came; the checkpoint stands at the last whole epoch.
        ValueError, OSError: as of `ClosedLoopWorlds`.
    """
    torch.manual_seed(settings.seed)  # the networks' first weights
    generator = torch.Generator().manual_seed(settings.seed)
    driver = Driver(DrivingNetwork(), DrivingNetwork(), settings.sigma)
    update = PolicyUpdate(driver, settings.update)
    with (
        rollout_collector(
            partial(environments, settings),
            driver,
            worlds=settings.worlds,
            steps=settings.steps,
            epochs=settings.epochs,
            seed=settings.seed,
            threads=settings.threads,
            workers=settings.workers,
        ) as collector,
        Epochs("PPO", settings.epochs, folder, settings.checkpoint_every, progress) as epochs,
    ):
        epochs.resume(driver=driver, optimizer=update.optimizer, collector=collector, generator=generator)
        for _, rollout in zip(epochs, collector, strict=True):
            row: dict[str, Any] = _seen(rollout)
            reward = rollout["next", "reward"]
            reward.clamp_(min=settings.least_reward).mul_(settings.reward_scale)
            samples = update.advantages(rollout)
            rate = linear(settings.learning_rate, settings.last_learning_rate, epochs.share)
            row |= update(samples, rate, generator)
            driver.sigma.fill_(geometric(settings.sigma, settings.last_sigma, epochs.share))
            collector.update_policy_weights_()
            if epochs.is_due:
                runs = _watched(driver.policy, settings)
                row["validation"] = {
                    name: {gap: dataclasses.asdict(run) for gap, run in of_map.items()} for name, of_map in runs.items()
                }
                every = [run for of_map in runs.values() for run in of_map.values()]
                alone = _alone(driver.policy, settings)
                row["empty_road"] = alone.figures()
                epochs.show(
                    reward=" ".join(f"{run.reward:.2f}" for run in every),
                    collisions=" ".join(f"{run.collisions:.1e}" for run in every),
                    speed=" ".join(f"{run.speed:.1f}" for run in every),
                    alone=f"{alone.least:.2f}",
                )
            epochs.end(row)
    return driver


def environments(settings: PpoSettings, *, worlds: int, threads: int) -> list[ClosedLoopEnv]:
    """The training's worlds, an environment for each map and each of who decides about gaps there.

    Raises:
        ValueError: they cannot share so many worlds; or as of `ClosedLoopWorlds`.
    """
    both = [(name, gap) for gap in settings.gaps for name in settings.map]
    try:
        counts = shares(worlds, len(both))
    except ValueError as error:
        raise ValueError(f"map: {len(settings.map)}, gaps: {len(settings.gaps)}: {error}") from None
    return [
        ClosedLoopEnv(name, worlds=count, vehicles=settings.vehicles, gap=gap, threads=threads, desynchronise=True)
        for (name, gap), count in zip(both, counts, strict=True)
    ]


def _seen(rollout: TensorDict) -> dict[str, float]:
    """What a rollout shows, as acted with noise: mean reward of a step, collisions a second and vehicle, speed."""
    return {
        "reward": float(rollout["next", "reward"].mean()),
        "collisions": float(rollout["next", "terminated"].float().mean()) / DT,
        "speed": float(rollout["observation"][..., Driving.SPEED].mean()),
        "ends": float(rollout["next", "done"].float().mean()) / DT,
    }


def _watched(policy: DrivingNetwork, settings: PpoSettings) -> dict[str, dict[str, ValidationRun]]:
    """Short runs by the mean action, on each map with each of who decides about gaps."""
    return {
        name: {
            gap: validation_run(
                policy,
                map=name,
                gap=gap,
                seed=VALIDATION_SEED,
                vehicles=settings.vehicles,
                worlds=WATCHED_WORLDS,
                steps=WATCHED_STEPS,
            )
            for gap in settings.gaps
        }
        for name in settings.map
    }


def _alone(policy: DrivingNetwork, settings: PpoSettings) -> EmptyRoad:
    """How fast it is on the maps' empty roads, beside the calibrated IDM that ships."""
    predictor = Predictor(driving_policy(gap_decider(settings.gaps[0]), policy, {}), "ppo")
    return empty_road(predictor, maps=[Intersection.load(name) for name in settings.map])


def main(settings: PpoSettings) -> int:
    """Trains as told and writes the policy file `ppo.policy` into the run folder; returns the exit status."""
    if settings.seeds:
        return train_seeds(main, settings)
    with Command(settings.run / "ppo.policy") as command:
        deciders = [gap_decider(gap) for gap in settings.gaps]
        maps = [Intersection.load(name) for name in settings.map]
        if len({one.checksum for one in maps}) < len(maps):
            raise ValueError(f"--map names a map twice: {', '.join(settings.map)}")
        data = " ".join([*(gap_hash(decider) for decider in deciders), *(one.checksum for one in maps)])
        folder = RunFolder.begin(settings.run, decisive(settings), data, settings.resume, settings.tensorboard)
        driver = train_driver(settings, folder)
        about: dict[str, Any] = {"made_by": COMMAND, "settings": decisive(settings)}
        about |= {"maps": [one.name for one in maps], "validation_run": {}}
        for one in maps:
            about["validation_run"][one.name] = {}
            for gap in dict.fromkeys((*settings.gaps, "critical_gap")):
                run = validation_run(driver.policy, map=one, gap=gap, seed=VALIDATION_SEED)
                figures = {key: round(value, 6) for key, value in dataclasses.asdict(run).items()}
                about["validation_run"][one.name][gap] = figures
                print(f"{one.name}, 2000 s with 12 vehicles, gaps by {gap}: {figures}")
        alone = _alone(driver.policy, settings)
        about["empty_road"] = alone.figures()
        print(
            f"alone, speed after 10 s as a share of the calibrated IDM's: {about['empty_road']}; least: {alone.where}"
        )
        driving_policy(deciders[0], driver.policy, about).save(command.output)
    return command.status


if __name__ == "__main__":
    run_command(lambda: main(tyro.extras.overridable_config_cli(PROFILES, prog=COMMAND)))
