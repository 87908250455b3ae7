"""Trains the order network: by the likelihood of the recorded orders, over all feasible ones.

python -m agents.orders default --run runs/orders                              for the policy that is the default
python -m agents.orders default --policy mine.policy --scenes mine.npz --map mine.json --run runs/mine

What it writes is that policy with an order network and a spread, so that `forecast` can be asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch.nn.functional import binary_cross_entropy

from agents.networks.export import gap_hash, network_weights
from agents.networks.order import OrderNetwork
from agents.orders.likelihood import OrderBatch
from agents.orders.samples import OrderSample, order_samples
from agents.orders.spread import spread_of
from agents.training.command import Command
from agents.training.folder import RunFolder, decisive, file_hash, joint_hash
from agents.training.loop import Epochs
from agents.training.options import Maps
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import DEFAULT, policy_named
from intersection_env.scenes.places import ALL_SCENES, load_places, map_names
from intersection_env.scenes.scenes import Scenes, scenes_path

COMMAND = "python -m agents.orders"
RISE, LAST = 0.3, 0.01  # share of the updates in which the rate rises, and what it falls to
SORTED = 16  # ours: batches whose moments are sorted by their orders, so that little is padded


@dataclass(frozen=True)
class OrderSettings:
    """What a training of the order network depends on."""

    scenes: tuple[Path, ...] = ALL_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policy: str = DEFAULT
    """Who is to forecast: a policy that ships, or a policy file. The network does not depend on it; the spread does."""
    run: Path = Path("runs/orders")
    """The run folder."""
    resume: bool = False
    """Go on with the run in that folder."""
    epochs: int = 40
    batch: int = 128
    """Moments."""
    every: float = 1.0
    """Seconds between two moments."""
    learning_rate: float = 5e-3
    """The highest, risen to and fallen from."""
    pair_weight: float = 1.0
    """Of the likelihood of each pair's order by itself, beside that of the orders of a moment."""
    noise: float = 0.03
    """Deviation of what is added to the scaled features."""
    weight_decay: float = 0.1
    """Of AdamW."""
    seed: int = 0
    checkpoint_every: int = 5
    """Epochs."""


PROFILES = {"default": ("what ships", OrderSettings())}


def train_network(
    train: Sequence[OrderSample],
    development: Sequence[OrderSample],
    settings: OrderSettings,
    folder: RunFolder | None = None,
    progress: bool = True,
) -> OrderNetwork:
    """The trained network.

    Args:
        train, development: what to learn from, and what is watched.
        settings: how to train.
        folder: where metrics and checkpoints go; its checkpoint, if there is one, is where training goes on.
        progress: whether to show a bar.

    Raises:
        Interrupted: Ctrl-C or SIGTERM came; the checkpoint stands at the last whole epoch.
    """
    torch.manual_seed(settings.seed)  # the network's first weights
    network, generator = OrderNetwork(), torch.Generator().manual_seed(settings.seed)
    optimizer = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
    steps = settings.epochs * len(_batches(train, settings.batch, torch.Generator().manual_seed(0)))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, settings.learning_rate, steps, pct_start=RISE, cycle_momentum=False, final_div_factor=1.0 / LAST
    )
    with Epochs("order network", settings.epochs, folder, settings.checkpoint_every, progress) as epochs:
        epochs.resume(network=network, optimizer=optimizer, schedule=schedule, generator=generator)
        for _ in epochs:
            total = 0.0
            for rows in _batches(train, settings.batch, generator):
                batch = OrderBatch.of([train[row] for row in rows])
                drawn = torch.randn(batch.features.shape, generator=generator)
                logit = network(batch.features + settings.noise * drawn / network.scale)
                loss = batch.loss(logit) + settings.pair_weight * batch.pair_loss(logit)
                optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                optimizer.step()
                schedule.step()
                total += float(loss.detach()) * len(rows)
            row = {"loss": total / len(train)}
            if epochs.is_due:
                row |= scores(network, development)
                epochs.show(loss=f"{row['loss']:.3f}", development=f"{row['accuracy']:.4f}")
            epochs.end(row)
    return network


def _batches(samples: Sequence[OrderSample], size: int, generator: torch.Generator) -> list[list[int]]:
    """Rows of the samples at random, each once, such as need little padding together."""
    found = []
    for chunk in torch.split(torch.randperm(len(samples), generator=generator), size * SORTED):
        rows = sorted(chunk.tolist(), key=lambda row: len(samples[row].orders))
        found += [rows[first : first + size] for first in range(0, len(rows), size)]
    return [found[place] for place in torch.randperm(len(found), generator=generator).tolist()]


def scores(network: OrderNetwork, samples: Sequence[OrderSample]) -> dict[str, float]:
    """Of all pairs of known order: how often the more probable one came true, log loss, Brier score."""
    probability, yielder_first = [], []
    with torch.no_grad():
        for sample in samples:
            batch = OrderBatch.of([sample])
            known = batch.recorded[0] != 0
            probability.append(batch.probability(network(batch.features))[0, known])
            yielder_first.append((batch.recorded[0, known] > 0).float())
    found, truth = torch.cat(probability).clamp(1e-6, 1.0 - 1e-6), torch.cat(yielder_first)
    return {
        "accuracy": float(((found > 0.5) == (truth > 0.5)).double().mean()),
        "log_loss": float(binary_cross_entropy(found, truth)),
        "brier": float((found - truth).square().mean()),
    }


def with_forecast(
    policy: PolicyFile, network: OrderNetwork, scenes: Scenes | Sequence[Scenes], provenance: dict[str, Any]
) -> PolicyFile:
    """The policy with this order network and the spread of its own drivers in these scenes.

    Args:
        policy: who decides and drives.
        network: of any policy's training.
        scenes: those for development count, as drivers spread less in what they have learned from.
        provenance: what the file says about the network, under "orders".

    Raises:
        ValueError: nobody is recorded long enough.
    """
    plain = replace(policy, order_network=None, spread=None)
    about = {**policy.about, "orders": provenance}
    return replace(plain, about=about, order_network=network_weights(network), spread=spread_of(plain, scenes))


def main(settings: OrderSettings) -> int:
    """Trains as told and writes the policy file `orders.policy` into the run folder; returns the exit status."""
    with Command(settings.run / "orders.policy") as command:
        policy, _ = policy_named(settings.policy)
        places = load_places(settings.scenes, settings.map)
        hashes = [file_hash(scenes_path(name)) for name in settings.scenes]
        train, left_out = order_samples(places, "train", settings.every)
        development, _ = order_samples(places, "development", settings.every)
        data = joint_hash([*hashes, gap_hash(policy)])
        folder = RunFolder.begin(settings.run, decisive(settings), data, settings.resume)
        print(f"{len(train)} moments to learn from, {len(development)} for development; left out: {left_out}")
        network = train_network(train, development, settings, folder)
        found = {key: round(value, 4) for key, value in scores(network, development).items()}
        print(f"development: {found}")
        about = {"made_by": COMMAND, "settings": decisive(settings), "maps": map_names(places), "sha256": hashes}
        with_forecast(policy, network, places, {**about, "development": found}).save(command.output)
    return command.status
