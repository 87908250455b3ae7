"""Trains the driver by GAIL: in the replays, until a discriminator cannot tell it from the recorded drivers.

python -m imitation.gail default --ppo runs/ppo --run runs/gail
python -m imitation.gail default --scenes bendplatz t_junction --ppo runs/ppo --run runs/two
python -m imitation.gail paper --scenes mine.npz --map mine.json --run runs/mine
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from tensordict import TensorDict

from agents.networks.driving import Driver, DrivingNetwork
from agents.networks.export import driving_network, driving_policy, gap_hash
from agents.rollouts.envs import ReplayEnv
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.rollouts.workers import rollout_collector, shares
from agents.training.command import Command
from agents.training.folder import CHECKPOINT, RunFolder, decisive, file_hash, joint_hash, state_hash
from agents.training.loop import Epochs, geometric, linear
from agents.training.options import Maps, Seeds
from agents.training.seeds import train_seeds
from imitation.cloning import Cloning, Examples, examples_of
from imitation.closer_look import closer_look, last_look, watched
from imitation.discriminator import Discriminator, DiscriminatorLoss, DiscriminatorSettings
from imitation.empty_road_states import empty_road_states
from imitation.expert import ExpertSteps, expert_steps
from imitation.usable_places import usable_places
from intersection_env.command import run_command
from intersection_env.evaluation.gates import LEAST_SPEED
from intersection_env.policies.named import gap_decider
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import ALL_SCENES, each_place, map_names
from intersection_env.scenes.scenes import Scenes, scenes_path

COMMAND = "python -m imitation.gail"


@dataclass(frozen=True)
class GailSettings:
    """What a training of the driver by GAIL depends on."""

    scenes: tuple[Path, ...] = ALL_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several, each in
    an equal share of the worlds."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    ppo: Path | None = Path("runs/ppo")
    """The run folder of the PPO training to go on from."""
    policy: str | None = None
    """A policy with a driving network (by name or file), with which to begin instead of PPO's; the value network stays
    PPO's."""
    run: Path = Path("runs/gail")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    gap: str = "recording"
    """Who decides about gaps in the replays: the recording, or a policy with a gap network."""
    decider: str = "gap"
    """Who decides about gaps in the policy that is written: a policy with a gap network, critical_gap or sumo."""
    worlds: int = 256
    """Of all places; shares differ by one where they cannot be equal."""
    steps: int = 64
    """Of each world in an epoch; 16384 steps in all, paper, Table III."""
    epochs: int = 500
    value_epochs: int = 5
    """First ones in which policy stays as it is, and the value network gets used to the new reward."""
    learning_rate: float = 1e-3
    last_learning_rate: float = 1e-4
    """Fallen to linearly."""
    sigma: float = 0.15
    """Deviation of the action before its tanh."""
    last_sigma: float = 0.05
    """Fallen to geometrically."""
    reward_scale: float = 0.1
    """Rewards are multiplied by it."""
    bootstrap_ends: bool = False
    """Whether the value of what was seen last stands for what follows where a track or a route ends; else nothing
    follows, and 0, the reward where there is no telling, stands for it."""
    cloning: float = 0.2
    """Weight in the policy's loss of the squared difference to the recorded accelerations [1/(m/s²)²]."""
    kept: float = 0.35
    """Share of the states that are cloned in which a car is alone on an empty road, and the policy that was begun with
    is followed."""
    update: UpdateSettings = field(default_factory=lambda: UpdateSettings(passes=5, minibatches=8))
    discriminator: DiscriminatorSettings = field(default_factory=DiscriminatorSettings)
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


CLONED, EMPTY_ROAD = 2048, 4000
"""States in each update, about as many as a minibatch of the replays has, and of an empty road on each map; ours."""
PROFILES = {
    "default": ("in minutes on two cores", GailSettings()),
    "paper": (
        "the paper's Table III",
        GailSettings(
            epochs=12_000,
            learning_rate=3e-4,
            last_learning_rate=3e-5,
            bootstrap_ends=True,
            cloning=0.0,
            kept=0.0,
            update=UpdateSettings(passes=10, minibatches=1),
            discriminator=DiscriminatorSettings(minibatches=1, gradient_penalty=1.0),
        ),
    ),
}


def train_driver(
    scenes: Scenes | Sequence[Scenes],
    start: Driver | None,
    settings: GailSettings,
    folder: RunFolder | None = None,
    progress: bool = True,
) -> Driver:
    """The trained driver: its policy is that of the checkpoint that predicts development best.

    A checkpoint that stands or crawls on an empty road counts only if all do.

    Args:
        scenes: recorded scenes, of one place or several; those for training are learned from, those for development
            watched.
        start: whose networks to begin with; None: random ones.
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C or SIGTERM came; the checkpoint stands at the last whole epoch.
        ValueError: no usable scene.
    """
    decider, places = gap_decider(settings.decider), each_place(scenes)
    seen = watched(places)
    if not seen:
        raise ValueError("no moment of the development scenes to predict from")
    best: dict[str, Any] = {"crawls": True, "error": float("inf")}
    torch.manual_seed(settings.seed)  # the networks' first weights
    generator = torch.Generator().manual_seed(settings.seed)
    steps = ExpertSteps.joined([expert_steps(place, "train", settings.gap) for place in places])
    expert = torch.from_numpy(steps.observation)
    driver = Driver(DrivingNetwork(), DrivingNetwork(), settings.sigma)
    if start is not None:
        driver.policy.load_state_dict(start.policy.state_dict())
        driver.value.load_state_dict(start.value.state_dict())
    update = PolicyUpdate(driver, settings.update)
    discriminator = Discriminator.of(expert)
    loss = DiscriminatorLoss(discriminator, settings.discriminator, generator)
    optimizer = torch.optim.Adam(discriminator.parameters(), lr=settings.discriminator.learning_rate)
    cloning = Cloning(driver.policy, _examples(steps, start, places, settings), generator)

    def make(*, worlds: int, threads: int) -> list[ReplayEnv]:
        counts = shares(worlds, len(places))
        return [
            ReplayEnv(place, split="train", gap=settings.gap, desynchronise=True, worlds=count, threads=threads)
            for place, count in zip(places, counts, strict=True)
        ]

    with (
        rollout_collector(
            make,
            driver,
            worlds=settings.worlds,
            steps=settings.steps,
            epochs=settings.epochs,
            seed=settings.seed,
            threads=settings.threads,
            workers=settings.workers,
        ) as collector,
        Epochs("GAIL", settings.epochs, folder, settings.checkpoint_every, progress) as epochs,
    ):
        epochs.resume(
            driver=driver,
            optimizer=update.optimizer,
            discriminator=discriminator,
            discriminator_optimizer=optimizer,
            collector=collector,
            generator=generator,
            best=best,
        )
        for epoch, rollout in zip(epochs, collector, strict=True):
            row: dict[str, Any] = {}
            acted = rollout["observation"].reshape(-1, expert.shape[1])
            for part in settings.discriminator.parts(acted, generator):
                shown = expert[torch.randint(len(expert), (len(part),), generator=generator)]
                terms = loss(TensorDict({"expert": shown, "policy": part}))
                row["accuracy"] = float(terms["accuracy"])
                if row["accuracy"] <= settings.discriminator.most_accuracy:
                    optimizer.zero_grad()
                    terms["loss_discriminator"].backward()
                    optimizer.step()
            row["loss_discriminator"] = float(terms["loss_discriminator"].detach())
            reward = discriminator.reward(rollout["observation"]).unsqueeze(-1)
            row["reward"] = float(reward.mean())
            rollout["next", "reward"].copy_(settings.reward_scale * reward)
            if not settings.bootstrap_ends:
                rollout["next", "terminated"].copy_(rollout["next", "done"])
            samples = update.advantages(rollout)
            rate = linear(settings.learning_rate, settings.last_learning_rate, epochs.share)
            beside = (lambda: settings.cloning * cloning()) if settings.cloning else None
            row |= update(samples, rate, generator, value_only=epoch <= settings.value_epochs, beside=beside)
            driver.sigma.fill_(geometric(settings.sigma, settings.last_sigma, epochs.share))
            collector.update_policy_weights_()
            if epochs.is_due:
                row |= closer_look(driver.policy, driving_policy(decider, driver.policy, {}), places, seen)
                found = {"crawls": row["empty_road"]["least"] < LEAST_SPEED, "error": row["predicted"]}
                if (found["crawls"], found["error"]) < (best["crawls"], best["error"]):
                    best |= found | {"epoch": epoch, "policy": deepcopy(driver.policy.state_dict())}
                epochs.show(
                    accuracy=f"{row['accuracy']:.2f}",
                    alone="nobody" if (alone := row["development"]["rmse"]) is None else f"{alone:.1f}",
                    bias=f"{row['until_last_seen']['bias']:.1f}",
                    empty=f"{row['empty_road']['least']:.2f}",
                    best=f"{best['error']:.2f}",
                )
            epochs.end(row)
    driver.policy.load_state_dict(best["policy"])
    return driver


def start_of(run: Path) -> Driver:
    """The driver in the last checkpoint of a PPO training.

    Raises:
        ValueError: the folder has no checkpoint, or one that is damaged or of another kind of training.
    """
    if not (run / CHECKPOINT).is_file():
        raise ValueError(f"{run} holds no checkpoint to begin with: train by python -m agents.ppo, or choose a --ppo")
    try:
        state = torch.load(run / CHECKPOINT, weights_only=True)
    except Exception as error:  # torch raises whatever its unpickler does
        raise ValueError(f"{run / CHECKPOINT} is damaged: {error}") from error
    driver = Driver(DrivingNetwork(), DrivingNetwork(), 1.0)
    try:
        driver.load_state_dict(state["driver"])
    except (KeyError, TypeError, AttributeError, RuntimeError) as error:
        raise ValueError(f"{run / CHECKPOINT} is of no training by python -m agents.ppo: {error}") from error
    return driver


def begun_with(name: str, start: Driver | None) -> Driver:
    """A driver with the driving network of a policy, and the value network of `start`; without, a random one.

    Raises:
        ValueError: no such policy, or one in which no network drives.
    """
    driver = Driver(driving_network(Predictor.load(name).policy), DrivingNetwork(), 1.0)
    if start is not None:
        driver.value.load_state_dict(start.value.state_dict())
    return driver


def _hashes(settings: GailSettings, start: Driver | None) -> dict[str, Any]:
    """SHA-256 of all that is learned from, by name; of the scenes one a file."""
    hashes: dict[str, Any] = {"scenes": [file_hash(scenes_path(name)) for name in settings.scenes]}
    if start is not None:
        hashes["ppo"] = state_hash(start.state_dict())
    if settings.gap != "recording":
        hashes["gap"] = gap_hash(gap_decider(settings.gap))
    return hashes


def _examples(
    steps: ExpertSteps, start: Driver | None, places: Sequence[Scenes], settings: GailSettings
) -> list[Examples]:
    """What is cloned: the recorded drivers where they were, and PPO's policy, if there is one, on an empty road."""
    kept = 0 if start is None else round(settings.kept * CLONED)
    examples = [Examples(torch.from_numpy(steps.observation), torch.from_numpy(steps.acceleration), CLONED - kept)]
    if start is not None and kept:
        random = np.random.default_rng(settings.seed)
        alone = [empty_road_states(place.intersection, EMPTY_ROAD, random) for place in places]
        examples.append(examples_of(start.policy, torch.from_numpy(np.concatenate(alone)), kept))
    return examples


def main(settings: GailSettings) -> int:
    """Trains as told and writes the policy file `gail.policy` into the run folder; returns the exit status."""
    if settings.seeds:
        return train_seeds(main, settings)
    with Command(settings.run / "gail.policy") as command:
        if not 0.0 <= settings.kept < 1.0:
            raise ValueError(f"kept is {settings.kept}; wanted a share from 0 to below 1")
        decider = gap_decider(settings.decider)
        places = usable_places(settings.scenes, settings.map)
        start = None if settings.ppo is None else start_of(settings.ppo)
        start = start if settings.policy is None else begun_with(settings.policy, start)
        hashes = _hashes(settings, start)
        data = joint_hash([*hashes["scenes"], *(one for name, one in hashes.items() if name != "scenes")])
        folder = RunFolder.begin(settings.run, decisive(settings), data, settings.resume, settings.tensorboard)
        driver = train_driver(places, start, settings, folder)
        about: dict[str, Any] = {"made_by": COMMAND, "settings": decisive(settings)}
        about |= {"maps": map_names(places), "sha256": hashes}
        about |= last_look(driver.policy, driving_policy(decider, driver.policy, {}), places, "gail")
        driving_policy(decider, driver.policy, about).save(command.output)
    return command.status


if __name__ == "__main__":
    run_command(lambda: main(tyro.extras.overridable_config_cli(PROFILES, prog=COMMAND)))
