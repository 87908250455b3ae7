"""Trains the gap network: supervised, through the minimum over each yielder's foes.

python -m agents.gap default --run runs/gap                                   on all places that ship
python -m agents.gap default --scenes bendplatz t_junction --run runs/two     on two of them
python -m agents.gap paper --scenes mine.npz --map mine.json --run runs/mine  on one's own
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from agents.gap.samples import Foes, GapSamples, gap_samples
from agents.networks.export import policy_file
from agents.networks.gap import GapNetwork, least_logit
from agents.training.command import Command
from agents.training.folder import RunFolder, decisive, file_hash, joint_hash
from agents.training.loop import Epochs
from agents.training.options import Maps
from intersection_env.scenes.places import ALL_SCENES, load_places, map_names
from intersection_env.scenes.scene import SPLITS
from intersection_env.scenes.scenes import scenes_path

COMMAND = "python -m agents.gap"
INPUT_NOISE = (0.5, 0.1, 2.0, 2.0)  # [m], [m/s], as `Gap` has them; paper, Section IV-B.1
CYCLE = 100  # ours: the paper names CyclicLR, not its period; batches up, and as many down
TEMPERATURES = np.geomspace(0.3, 3.0, 301)


@dataclass(frozen=True)
class GapSettings:
    """What a training of the gap network depends on; the defaults did best on the development recordings."""

    scenes: tuple[Path, ...] = ALL_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    run: Path = Path("runs/gap")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    epochs: int = 200
    batch: int = 2048
    learning_rate: float = 1e-2
    schedule: Literal["falling", "cyclic"] = "falling"
    """Falling linearly to a fiftieth, or cyclic (paper) between a tenth of the rate and the rate."""
    noise: float = 0.5
    """Input noise, in units of the paper's."""
    foes: Foes = "all"
    """Which prioritized vehicles count in training."""
    calibrate: bool = True
    """Divide the logits by a temperature fitted on the development recordings; no decision changes."""
    seed: int = 0
    checkpoint_every: int = 10
    """Epochs."""


PROFILES = {
    "default": ("what does best on the development recordings", GapSettings()),
    "paper": (
        "the paper's Table III",
        GapSettings(epochs=1000, batch=8192, learning_rate=1e-3, schedule="cyclic", noise=1.0, calibrate=False),
    ),
}


@dataclass(frozen=True)
class PaddedSamples:
    """Samples as tensors: features (sample, foe, 4), there (sample, foe) bool, label (sample,) 0 or 1."""

    features: Tensor
    there: Tensor
    label: Tensor

    @classmethod
    def of(cls, samples: GapSamples) -> PaddedSamples:
        features, there = samples.padded()
        label = torch.from_numpy(samples.labels().astype(np.float32))
        return cls(torch.from_numpy(features), torch.from_numpy(there), label)


def train_network(
    train: GapSamples,
    development: GapSamples,
    settings: GapSettings,
    folder: RunFolder | None = None,
    progress: bool = True,
) -> GapNetwork:
    """The trained and calibrated network.

    Args:
        train, development: samples with known labels (`GapSamples.select`).
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C or SIGTERM came; the checkpoint stands at the last whole epoch.
    """
    torch.manual_seed(settings.seed)  # the network's first weights
    network, generator = GapNetwork(), torch.Generator().manual_seed(settings.seed)
    data, held_out = PaddedSamples.of(train), PaddedSamples.of(development)
    noise = settings.noise * torch.tensor(INPUT_NOISE)
    batches = -(-len(data.label) // settings.batch)
    optimizer = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    schedule = _schedule(settings, optimizer, settings.epochs * batches)
    with Epochs("gap network", settings.epochs, folder, settings.checkpoint_every, progress) as epochs:
        epochs.resume(network=network, optimizer=optimizer, schedule=schedule, generator=generator)
        for _ in epochs:
            total = 0.0
            for rows in torch.split(torch.randperm(len(data.label), generator=generator), settings.batch):
                clean = data.features[rows]
                noisy = clean + noise * torch.randn(clean.shape, generator=generator)
                loss = binary_cross_entropy_with_logits(least_logit(network, noisy, data.there[rows]), data.label[rows])
                optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                optimizer.step()
                schedule.step()
                total += float(loss.detach()) * len(rows)
            row = {"loss": total / len(data.label)}
            if epochs.is_due:
                row |= scores(network, held_out)
                epochs.show(loss=f"{row['loss']:.4f}", development=f"{row['accuracy']:.4f}")
            epochs.end(row)
    if settings.calibrate:
        _divide_logits(network, best_temperature(network, held_out))
    return network


def scores(network: GapNetwork, data: PaddedSamples) -> dict[str, float]:
    """Accuracy and log loss of the decisions (sample,)."""
    with torch.no_grad():
        logit = least_logit(network, data.features, data.there)
        right = (logit > 0) == (data.label > 0)
        return {
            "accuracy": float(right.double().mean()),
            "log_loss": float(binary_cross_entropy_with_logits(logit, data.label)),
        }


def best_temperature(network: GapNetwork, data: PaddedSamples) -> float:
    """The temperature at which the log loss is least, on a grid from 0.3 to 3."""
    with torch.no_grad():
        logit = least_logit(network, data.features, data.there).double()
        label = data.label.double()
        losses = [float(binary_cross_entropy_with_logits(logit / t, label)) for t in TEMPERATURES]
    return float(TEMPERATURES[int(np.argmin(losses))])


def _schedule(
    settings: GapSettings, optimizer: torch.optim.Optimizer, steps: int
) -> torch.optim.lr_scheduler.LRScheduler:
    if settings.schedule == "cyclic":
        rate = settings.learning_rate
        return torch.optim.lr_scheduler.CyclicLR(optimizer, rate / 10.0, rate, CYCLE, cycle_momentum=False)
    return torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.02, steps)


def _divide_logits(network: GapNetwork, temperature: float) -> None:
    with torch.no_grad():
        for parameter in network.layers[-1].parameters():
            parameter.div_(temperature)


def main(settings: GapSettings) -> int:
    """Trains as told and writes the policy file `gap.policy` into the run folder; returns the exit status."""
    with Command(settings.run / "gap.policy") as command:
        places = load_places(settings.scenes, settings.map)
        hashes = [file_hash(scenes_path(name)) for name in settings.scenes]
        folder = RunFolder.begin(settings.run, decisive(settings), joint_hash(hashes), settings.resume)
        samples, left_out = gap_samples(places)
        train, development = (samples.of_split(places, split).select(settings.foes) for split in SPLITS[:2])
        for split, part in zip(SPLITS, (train, development), strict=False):
            if not len(part):
                names = ", ".join(map(str, settings.scenes))
                raise ValueError(f'{names}: no sample of split "{split}" of which it is known who went first')
        print(f"{len(train)} samples to learn from, {len(development)} for development; left out: {left_out}")
        network = train_network(train, development, settings, folder)
        about: dict[str, Any] = {"made_by": COMMAND, "settings": decisive(settings)}
        about["data"] = {"maps": map_names(places), "sha256": hashes}
        about["development"] = {}
        for foes in ("recorded", "all"):
            held_out = PaddedSamples.of(samples.of_split(places, "development").select(foes))
            if not len(held_out.label):
                continue
            about["development"][foes] = {key: round(value, 4) for key, value in scores(network, held_out).items()}
            print(f"development, {foes} foes: {about['development'][foes]}")
        policy_file(network, about).save(command.output)
    return command.status
