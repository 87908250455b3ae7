"""Trains the driver by the gradient of its rollouts: predictions are differentiable, so errors after 10 s teach it.

python -m imitation.rollout_gradient default --run runs/rollout_gradient                     on all places that ship
python -m imitation.rollout_gradient alone --scenes bendplatz --run runs/alone               one place, one at a time
python -m imitation.rollout_gradient default --scenes mine.npz --map mine.json --run runs/mine

Each driver goes alone among recorded vehicles, in their order; later in the training all vehicles of other moments are
predicted jointly beside it, and the gap network learns too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from torch import Tensor, nn
from torch.nn.functional import huber_loss

from agents.networks.driving import DRIVING_SCALE, DrivingNetwork
from agents.networks.export import driving_policy, gap_hash, gap_network, policy_file
from agents.networks.gap import GapNetwork
from agents.training.command import Command
from agents.training.folder import RunFolder, decisive, file_hash, joint_hash
from agents.training.loop import Epochs
from agents.training.options import Maps, Seeds
from agents.training.seeds import train_seeds
from imitation.adjoint import Motion, backward
from imitation.closer_look import closer_look, last_look, watched
from imitation.drives import Drives, free_drives, joined, recorded_drives
from imitation.examples import free_examples, recorded_examples, teacher_named
from imitation.joint_moments import JointMoments
from imitation.map_tables import MapTables
from imitation.torch_model import TorchPredictor
from imitation.torch_networks import Networks
from imitation.usable_places import usable_places
from intersection_env.command import run_command
from intersection_env.constants import STEPS
from intersection_env.evaluation.moments import followed
from intersection_env.evaluation.places import moments_in
from intersection_env.maps.intersection import Intersection
from intersection_env.maps.limits import with_limits
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import gap_decider
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import ALL_SCENES, each_place, map_names
from intersection_env.scenes.scenes import Scenes, scenes_path

COMMAND = "python -m imitation.rollout_gradient"


@dataclass(frozen=True)
class RolloutSettings:
    """What a training of the driver through its own rollouts depends on."""

    scenes: tuple[Path, ...] = ALL_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    run: Path = Path("runs/rollout_gradient")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    decider: str = "gap"
    """Who decides about gaps: a policy with a gap network, from which that one begins to learn."""
    epochs: int = 32
    """Each once through all drives of one vehicle alone among recorded ones, with the recorded order as delta."""
    alone_share: float = 0.25
    """Of the epochs, the first ones: they have no more than that. In the others moments are predicted jointly too, in
    which the gap network decides."""
    joint_weight: float = 1.0
    """Of the error of these."""
    learns_gaps: bool = True
    """Whether the gap network learns too from them."""
    steps: int = STEPS
    """Of a drive alone; predictions have all."""
    limits: tuple[float, ...] = (1.0, 0.75, 1.4)
    """Each place is learned from with each of these times the speed limits of its map: on a map that is no copy of
    these they may be guessed, or nobody keeps to them, and what counts more is how fast somebody drives."""
    every: float = 3.0
    """Seconds between the starts of drives alone, and between the moments, of each place and limit."""
    drives: int = 512
    """Of an update."""
    moments: int = 64
    """Of an update, drawn at random."""
    free_share: float = 0.15
    """Free drives for each recorded one of an update, as the teacher drives them."""
    free_drives: int = 4000
    """From which these are drawn."""
    free_maps: tuple[str, ...] = ("roundabout",)
    """Maps (names, or files) that are driven freely too, though nobody is recorded there: who has never seen a ring
    stands in it."""
    teacher: str = "idm_calibrated"
    """A policy, whose free drives are learned from where nobody is recorded."""
    learning_rate: float = 5e-3
    """The highest, risen to and fallen from linearly."""
    huber: float = 3.0
    """Position errors count linearly beyond it [m], for the driver."""
    gap_huber: float = 15.0
    """Likewise where the gap network learns. Where it is small, nearly all of those who might go wait, as most do."""
    speed_weight: float = 0.3
    """Of the squared speed error."""
    effort_weight: float = 0.05
    """Of the squared acceleration."""
    noise: float = 0.0
    """Deviation of what is added to the scaled features of who drives alone."""
    gradient_norm: float = 1.0
    """Longer gradients are shortened to it."""
    seed: int = 0
    seeds: Seeds = ()
    """Train once with each of these instead of `seed`, side by side as Ray tasks, in the folders RUN/seed_0, ..."""
    tensorboard: bool = False
    """Write the figures for TensorBoard too, into the run folder."""
    checkpoint_every: int = 8
    """Epochs."""

    @property
    def alone_epochs(self) -> int:
        """How many of them."""
        return round(self.alone_share * self.epochs)


PROFILES = {
    "default": ("what ships", RolloutSettings()),
    "alone": ("without joint rollouts", RolloutSettings(epochs=20, alone_share=1.0)),
}
RISE, LAST = 0.2, 0.02  # share of the updates in which the rate rises, and what it falls to


@dataclass(frozen=True)
class Data:
    """What is learned from, as tensors: drives of one vehicle, the free ones last, and moments."""

    tables: MapTables
    drives: Drives
    moments: JointMoments | None

    @classmethod
    def of(cls, places: Sequence[Scenes], settings: RolloutSettings) -> Data:
        """The training scenes of these places, with each of the limits.

        Raises:
            ValueError, OSError: as of `Intersection.load`, of the maps that are driven freely, and of `MapTables`.
        """
        roads = [Scenes(Intersection.load(name), (), {}, {}) for name in settings.free_maps]
        places, roads = (
            [_limited(one, times) for one in some for times in settings.limits] for some in (places, roads)
        )
        driven = [*(place.select("train") for place in places), *roads]
        tables, generator = MapTables.of([one.intersection for one in driven]), np.random.default_rng(settings.seed)
        free = free_examples(driven, teacher_named(settings.teacher), settings.free_drives, generator)
        recorded = recorded_drives(tables, places, "train", settings.every)
        moments = None
        if settings.alone_epochs < settings.epochs:
            seen = followed(moments_in(places, "train", settings.every)[0])
            moments = JointMoments.of(tables, recorded_examples(seen))
        return cls(tables, joined(recorded, free_drives(tables, free)), moments)


def _limited(place: Scenes, times: float) -> Scenes:
    return replace(place, intersection=with_limits(place.intersection, times))


def train_driver(
    scenes: Scenes | Sequence[Scenes],
    settings: RolloutSettings,
    folder: RunFolder | None = None,
    progress: bool = True,
) -> tuple[DrivingNetwork, GapNetwork]:
    """The trained driver, and who decides about gaps for it.

    Args:
        scenes: recorded scenes, of one place or several; those for training are learned from, those for development
            watched.
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C or SIGTERM came; the checkpoint stands at the last whole epoch.
        ValueError: no usable scene, or a decider without a gap network.
    """
    places = each_place(scenes)
    torch.manual_seed(settings.seed)  # the network's first weights
    generator = torch.Generator().manual_seed(settings.seed)
    driver, gaps = DrivingNetwork(), gap_network(gap_decider(settings.decider)).requires_grad_(settings.learns_gaps)
    networks, data, seen = Networks(driver, gaps), Data.of(places, settings), watched(places)
    optimizer = torch.optim.Adam([*driver.parameters(), *gaps.parameters()])
    with Epochs("rollouts", settings.epochs, folder, settings.checkpoint_every, progress) as epochs:
        epochs.resume(driver=driver, gaps=gaps, optimizer=optimizer, generator=generator)
        for epoch in epochs:
            losses = []
            is_joint = epoch > settings.alone_epochs
            for share, rows in _batches(data, settings, generator):
                for group in optimizer.param_groups:
                    group["lr"] = _rate(settings, epoch - 1 + share)
                optimizer.zero_grad()
                loss = [_backward_alone(data, networks, settings, rows, generator)]
                loss += [_backward_jointly(data, networks, settings, generator)] if is_joint else []
                losses.append(loss)
                for network in (driver, gaps):
                    nn.utils.clip_grad_norm_(network.parameters(), settings.gradient_norm)
                optimizer.step()
            row: dict[str, Any] = dict(
                zip(("loss_alone", "loss_joint"), np.mean(losses, axis=0).tolist(), strict=False)
            )
            if epochs.is_due:
                row |= closer_look(driver, _policy(networks), places, seen, True)
                epochs.show(
                    alone=f"{row['loss_alone']:.2f}",
                    predicted=f"{row['predicted']:.2f}",
                    bias=f"{row['until_last_seen']['bias']:.1f}",
                    empty=f"{row['empty_road']['least']:.2f}",
                )
            epochs.end(row)
    return driver, gaps


def _batches(data: Data, settings: RolloutSettings, generator: torch.Generator) -> Iterator[tuple[float, Tensor]]:
    """The drives of each update of an epoch, free ones last, and how much of the epoch is over: 0 to 1."""
    recorded = len(data.drives.route) - settings.free_drives
    parts = torch.split(torch.randperm(recorded, generator=generator), settings.drives)
    for place, rows in enumerate(parts):
        free = (round(settings.free_share * len(rows)),)
        beside = recorded + torch.randint(settings.free_drives, free, generator=generator)
        yield place / len(parts), torch.cat([rows, beside])


def _rate(settings: RolloutSettings, epochs: float) -> float:
    """After so many epochs."""
    return settings.learning_rate * float(np.interp(epochs / settings.epochs, (0.0, RISE, 1.0), (0.1, 1.0, LAST)))


def _backward_alone(
    data: Data, networks: Networks, settings: RolloutSettings, rows: Tensor, generator: torch.Generator
) -> float:
    """The loss of these drives; its gradients are added to the driver's weights."""
    drives, noise = data.drives.rows(rows), None
    if settings.noise:
        drawn = torch.randn((settings.steps, len(rows), len(DRIVING_SCALE)), generator=generator)
        noise = settings.noise * drawn / torch.tensor(DRIVING_SCALE)

    def error(motion: Motion) -> Tensor:
        return _error(settings, settings.huber, motion, drives.position.T, drives.speed.T, drives.known.T)

    return drives.backward(data.tables, networks, settings.steps, error, noise)


def _backward_jointly(data: Data, networks: Networks, settings: RolloutSettings, generator: torch.Generator) -> float:
    """The error of some moments' prediction; its gradients are added to the weights of both networks."""
    assert data.moments is not None
    moments = data.moments.rows(torch.randint(len(data.moments.width), (settings.moments,), generator=generator))
    rollout = moments.predicted(Predictor(_policy(networks), "in training"))
    model = TorchPredictor(data.tables, moments.vehicles, networks)

    def error(huber: float, motion: Motion) -> Tensor:
        error = _error(settings, huber, motion, moments.position, moments.speed, moments.scored)
        return settings.joint_weight * error

    of_driver, of_gaps = (partial(error, huber) for huber in (settings.huber, settings.gap_huber))
    return backward(model, moments.assignment, rollout, of_driver, of_gaps if settings.learns_gaps else None)


def _error(
    settings: RolloutSettings, huber: float, motion: Motion, position: Tensor, speed: Tensor, known: Tensor
) -> Tensor:
    """The mean over what is known after the start: (time, row) or (time, moment, vehicle) each."""
    then = slice(1, len(motion.position) + 1)
    far = huber_loss(motion.position, position[then], delta=huber, reduction="none")
    faster = settings.speed_weight * (motion.speed - speed[then]).square()
    error = far + faster + settings.effort_weight * motion.acceleration.square()
    return (error * known[then]).sum() / known[then].sum().clamp(min=1)


def _policy(networks: Networks) -> PolicyFile:
    assert isinstance(networks.driving, DrivingNetwork)
    assert isinstance(networks.gap, GapNetwork)
    return driving_policy(policy_file(networks.gap, {}), networks.driving, {})


def main(settings: RolloutSettings) -> int:
    """Trains as told and writes `rollout_gradient.policy` into the run folder; returns the exit status."""
    if settings.seeds:
        return train_seeds(main, settings)
    with Command(settings.run / "rollout_gradient.policy") as command:
        decider = gap_decider(settings.decider)
        gap_network(decider)  # refused, if it decides by a rule, before there is a folder
        if not settings.limits or not all(times > 0.0 for times in settings.limits):
            raise ValueError(f"limits are {settings.limits}; wanted at least one number above 0")
        places = usable_places(settings.scenes, settings.map)
        hashes: dict[str, Any] = {"scenes": [file_hash(scenes_path(name)) for name in settings.scenes]}
        hashes |= {"gap": gap_hash(decider), "teacher": gap_hash(teacher_named(settings.teacher).policy)}
        data = joint_hash([*hashes["scenes"], hashes["gap"], hashes["teacher"]])
        folder = RunFolder.begin(settings.run, decisive(settings), data, settings.resume, settings.tensorboard)
        driver, gaps = train_driver(places, settings, folder)
        about: dict[str, Any] = {"made_by": COMMAND, "settings": decisive(settings)}
        about |= {"maps": map_names(places), "sha256": hashes}
        policy = _policy(Networks(driver, gaps))
        about |= last_look(driver, policy, places, "rollout_gradient", True)
        replace(policy, about=about).save(command.output)
    return command.status


if __name__ == "__main__":
    run_command(lambda: main(tyro.extras.overridable_config_cli(PROFILES, prog=COMMAND)))
