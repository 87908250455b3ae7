"""Trains the driver by GAIL: in the replays, until a discriminator cannot tell it from the recorded drivers.

python -m imitation.gail default --scenes out/scenes.npz --ppo runs/ppo --run runs/gail
python -m imitation.gail paper --run runs/gail_paper
"""

from __future__ import annotations

import dataclasses
import hashlib
import sys
import time
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
import tyro
from tensordict import TensorDict
from tqdm import tqdm

from agents.networks.driving import Driver, DrivingNetwork
from agents.networks.export import driving_policy, gap_hash
from agents.rollouts.envs import ReplayEnv
from agents.rollouts.policy_update import PolicyUpdate, UpdateSettings
from agents.rollouts.workers import rollout_collector
from agents.training.folder import CHECKPOINT, RunFolder, file_hash, state_hash
from agents.training.interrupt import Interrupted, ctrl_c
from agents.training.seeds import train_seeds
from imitation.discriminator import Discriminator, DiscriminatorLoss, DiscriminatorSettings
from imitation.expert import expert_steps
from imitation.replay_error import HORIZON, replay_error
from intersection_env.constants import DT
from intersection_env.evaluation.errors import distance_error
from intersection_env.evaluation.moments import followed, moments_of
from intersection_env.policies.named import gap_decider
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scene import SPLITS
from intersection_env.scenes.scenes import Scenes
from intersection_env.worlds.recorded_tracks import steps_to_act
from intersection_env.worlds.replay import ReplayWorlds

BETWEEN_MOMENTS = 4.0  # [s], of those that are predicted
NOT_DECISIVE = ("scenes", "ppo", "run", "resume", "threads", "workers", "seeds", "tensorboard")


@dataclass(frozen=True)
class GailSettings:
    """What a training of the driver by GAIL depends on."""

    scenes: Path = Path("out/scenes.npz")
    """The scenes file; `python -m data.build` makes it."""
    ppo: Path | None = Path("runs/ppo")
    """The run folder of the PPO training to go on from."""
    run: Path = Path("runs/gail")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    gap: str = "recording"
    """Who decides about gaps in the replays: the recording, or a policy with a gap network."""
    decider: str = "gap"
    """Who decides about gaps in the policy that is written: a policy with a gap network, critical_gap or sumo."""
    worlds: int = 256
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
    update: UpdateSettings = field(default_factory=lambda: UpdateSettings(passes=5, minibatches=8))
    discriminator: DiscriminatorSettings = field(default_factory=DiscriminatorSettings)
    seed: int = 0
    threads: int = 0
    """That step the worlds, 0: one a core; they do not change what comes out."""
    workers: int = 0
    """Ray workers that share the worlds, on one machine or several, 0: none; they do not change what comes out."""
    seeds: tuple[int, ...] = ()
    """Train once with each of these instead of `seed`, side by side as Ray tasks, in the folders RUN/seed_0, ..."""
    tensorboard: bool = False
    """Write the figures for TensorBoard too, into the run folder."""
    checkpoint_every: int = 50
    """Epochs."""

    def decisive(self) -> dict[str, Any]:
        """The settings that decide the result, as JSON holds them."""
        kept = dataclasses.asdict(self)
        return {key: value for key, value in kept.items() if key not in NOT_DECISIVE}


PROFILES = {
    "default": ("in minutes on two cores", GailSettings()),
    "paper": (
        "the paper's Table III",
        GailSettings(
            epochs=12_000,
            learning_rate=3e-4,
            last_learning_rate=3e-5,
            update=UpdateSettings(passes=10, minibatches=1),
        ),
    ),
}


def train_driver(
    scenes: Scenes,
    start: Driver | None,
    settings: GailSettings,
    folder: RunFolder | None = None,
    progress: bool = True,
) -> Driver:
    """The trained driver: its policy is that of the checkpoint that predicts development best.

    Args:
        scenes: recorded scenes; those for training are learned from, those for development watched.
        start: whose networks to begin with; None: random ones.
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C was pressed; the checkpoint stands at the last whole epoch.
        ValueError: no usable scene.
    """
    decider = gap_decider(settings.decider)
    watched = followed(moments_of(scenes.select("development"), BETWEEN_MOMENTS)[0])
    if not watched:
        raise ValueError("no moment of the development scenes to predict from")
    best: dict[str, Any] = {"error": float("inf")}
    torch.manual_seed(settings.seed)  # the networks' first weights
    generator = torch.Generator().manual_seed(settings.seed)
    expert = torch.from_numpy(expert_steps(scenes, "train", settings.gap).observation)
    driver = Driver(DrivingNetwork(), DrivingNetwork(), settings.sigma)
    if start is not None:
        driver.policy.load_state_dict(start.policy.state_dict())
        driver.value.load_state_dict(start.value.state_dict())
    update = PolicyUpdate(driver, settings.update)
    discriminator = Discriminator.of(expert)
    loss = DiscriminatorLoss(discriminator, settings.discriminator, generator)
    optimizer = torch.optim.Adam(discriminator.parameters(), lr=settings.discriminator.learning_rate)

    def make(**shares: int) -> list[ReplayEnv]:
        return [ReplayEnv(scenes, split="train", gap=settings.gap, desynchronise=True, **shares)]

    sharing = rollout_collector(
        make,
        driver,
        worlds=settings.worlds,
        steps=settings.steps,
        epochs=settings.epochs,
        seed=settings.seed,
        threads=settings.threads,
        workers=settings.workers,
    )
    with sharing as collector, ctrl_c() as interrupted:
        state = folder.load() if folder else None
        if state is not None:
            driver.load_state_dict(state["driver"])
            update.optimizer.load_state_dict(state["optimizer"])
            discriminator.load_state_dict(state["discriminator"])
            optimizer.load_state_dict(state["discriminator_optimizer"])
            collector.load_state_dict(state["collector"])
            generator.set_state(state["generator"])
            best = state["best"]
        first = 0 if state is None else int(state["epoch"])
        bar = tqdm(total=settings.epochs, initial=first, desc="GAIL", disable=None if progress else True, unit="epoch")
        for epoch, rollout in enumerate(collector, first + 1):
            done = (epoch - 1) / max(settings.epochs - 1, 1)
            seen = rollout["observation"].reshape(-1, expert.shape[1])
            row: dict[str, Any] = {"epoch": epoch}
            for _ in range(settings.discriminator.updates):
                shown = expert[torch.randint(len(expert), (len(seen),), generator=generator)]
                terms = loss(TensorDict({"expert": shown, "policy": seen}))
                row["accuracy"] = float(terms["accuracy"])
                if row["accuracy"] <= settings.discriminator.most_accuracy:
                    optimizer.zero_grad()
                    terms["loss_discriminator"].backward()
                    optimizer.step()
            row["loss_discriminator"] = float(terms["loss_discriminator"].detach())
            reward = discriminator.reward(rollout["observation"]).unsqueeze(-1)
            row["reward"] = float(reward.mean())
            rollout["next", "reward"].copy_(settings.reward_scale * reward)
            rate = settings.learning_rate + done * (settings.last_learning_rate - settings.learning_rate)
            value_only = epoch <= settings.value_epochs
            row |= update(update.advantages(rollout), rate, generator, value_only)
            driver.sigma.fill_(settings.sigma * (settings.last_sigma / settings.sigma) ** done)
            collector.update_policy_weights_()
            bar.update()
            is_due = epoch == settings.epochs or epoch % settings.checkpoint_every == 0
            stop = interrupted()
            if is_due:
                error = replay_error(driver.policy, scenes, "development")
                predictor = Predictor(driving_policy(decider, driver.policy, {}), "gail")
                row |= {"development": dataclasses.asdict(error), "predicted": distance_error(predictor, watched)}
                if row["predicted"] < best["error"]:
                    best = {"error": row["predicted"], "epoch": epoch, "policy": deepcopy(driver.policy.state_dict())}
                bar.set_postfix(
                    accuracy=f"{row['accuracy']:.2f}", alone=f"{error.rmse:.1f}", best=f"{best['error']:.2f}"
                )
            if folder:
                folder.append(row)
                if is_due or stop:
                    folder.save(
                        {
                            "epoch": epoch,
                            "driver": driver.state_dict(),
                            "optimizer": update.optimizer.state_dict(),
                            "discriminator": discriminator.state_dict(),
                            "discriminator_optimizer": optimizer.state_dict(),
                            "collector": collector.state_dict(),
                            "generator": generator.get_state(),
                            "best": best,
                        }
                    )
            if stop and epoch < settings.epochs:
                raise Interrupted
    driver.policy.load_state_dict(best["policy"])
    return driver


def usable_scenes(path: Path) -> Scenes:
    """The scenes file's scenes, with vehicles to learn from and others to watch for 10 s.

    Raises:
        ValueError: the file is damaged or made for something else, or a split has no such vehicle.
        OSError: it cannot be read.
    """
    scenes = Scenes.load(path)
    for split, steps in zip(SPLITS, (1, HORIZON + 1), strict=False):
        try:
            recorded = ReplayWorlds(scenes, split=split).tracks
        except ValueError as error:
            raise ValueError(f'{path}, split "{split}": {error}') from None
        tracks = [track for scene in recorded.scenes for track in scene.tracks]
        if max(steps_to_act(tracks[index]) for index in recorded.actors) < steps:
            raise ValueError(f'{path}, split "{split}": nobody is recorded for more than {HORIZON * DT:.0f} s')
    return scenes


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


def _hashes(settings: GailSettings, start: Driver | None) -> dict[str, str]:
    """SHA-256 of all that is learned from, by name."""
    hashes = {"scenes": file_hash(settings.scenes)}
    if start is not None:
        hashes["ppo"] = state_hash(start.state_dict())
    if settings.gap != "recording":
        hashes["gap"] = gap_hash(gap_decider(settings.gap))
    return hashes


def main(settings: GailSettings) -> int:
    """Trains as told and writes the policy file `gail.policy` into the run folder; returns the exit status."""
    if settings.seeds:
        return train_seeds(main, settings)
    torch.set_num_threads(1)  # such small networks gain nothing from more
    begin = time.perf_counter()
    try:
        decider = gap_decider(settings.decider)
        scenes = usable_scenes(settings.scenes)
        start = None if settings.ppo is None else start_of(settings.ppo)
        hashes = _hashes(settings, start)
        data = hashlib.sha256(" ".join(hashes.values()).encode()).hexdigest()
        folder = RunFolder.begin(settings.run, settings.decisive(), data, settings.resume, settings.tensorboard)
        driver = train_driver(scenes, start, settings, folder)
        figures = dataclasses.asdict(replay_error(driver.policy, scenes, "development"))
        about: dict[str, Any] = {"made_by": "python -m imitation.gail", "settings": settings.decisive()}
        about |= {"map": scenes.intersection.name, "sha256": hashes}
        about["development"] = {key: round(value, 6) for key, value in figures.items()}
        print(f"alone among the recorded vehicles of development, 10 s: {about['development']}")
        driving_policy(decider, driver.policy, about).save(settings.run / "gail.policy")
    except Interrupted:
        print(f"interrupted; --resume goes on from {settings.run}", file=sys.stderr)
        return 130
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written: {settings.run / 'gail.policy'}, in {time.perf_counter() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.extras.overridable_config_cli(PROFILES)))
