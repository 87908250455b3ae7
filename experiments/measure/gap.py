"""How well gaps are decided: the gap network, the rules and the models beside it, with intervals over recordings.

python -m experiments.gap                        on the development recordings: what choices are made by
python -m experiments.gap --split validation     for the report, once
python -m experiments.gap --folds 5              k-fold by recording over all recordings, so for the report too

On the development recordings the network's calibration error flatters it: its temperature was fitted there.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import torch

from agents.gap.baselines import BASELINES, EVEN, Decider, PairModel
from agents.gap.samples import Foes, GapSamples, gap_samples
from agents.gap.train import GapSettings, train_network
from agents.networks.export import gap_network
from agents.networks.gap import GapNetwork
from agents.training.interrupt import Interrupted
from agents.training.options import Maps
from experiments.measure.gap_acceptance import acceptance_curves, chances, seen_gap
from experiments.measure.gap_scores import FOES, Tally, compare, pooled, tally
from experiments.measure.recorded import places_of
from experiments.results_files import check_outputs, write_result
from experiments.show.gap import BINS, NETWORK, measures_table, plot_acceptance
from intersection_env.evaluation.intervals import COVERAGE, RESAMPLES
from intersection_env.plots.files import write_figure
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import policy_path
from intersection_env.scenes.places import PAPERS_SCENES, load_places


@dataclass(frozen=True)
class Options:
    """Accuracy and calibration of gap decisions."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policy: str = "gap"
    """A policy file with a gap network, or the name of a shipped one."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    folds: int = 0
    """From 2 on: so many folds over all recordings, the network trained in each, instead of a split."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw acceptance over time gap (.png, .svg, .pdf); not with folds."""


def decider_of(network: GapNetwork) -> Decider:
    """The network as a decider."""
    return PairModel(lambda samples: chances(network, samples.features))


def on_split(network: GapNetwork, train: GapSamples, test: GapSamples) -> dict[str, Any]:
    """The results by foes; baselines are trained on the same foes as they are measured on."""
    results: dict[str, Any] = {}
    for foes in FOES:
        learn, judge = train.select(foes), test.select(foes)
        recordings = sorted(set(judge.sample_recording.tolist()))
        results[foes] = compare(_tallies(decider_of(network), learn, judge, recordings))
    return results


def on_folds(samples: GapSamples, folds: int, settings: GapSettings) -> dict[str, Any]:
    """The results by foes, from k folds of recordings; in each, all is trained without the fold.

    The network's temperature is fitted on the fold after it, which nothing learns from either.

    Raises:
        ValueError: fewer recordings than folds, or fewer than three folds.
    """
    recordings = sorted(set(samples.sample_recording.tolist()))
    if not 3 <= folds <= len(recordings):
        raise ValueError(f"--folds is {folds}; wanted 3 to {len(recordings)}, the number of recordings")
    parts = [recordings[k::folds] for k in range(folds)]
    tallies: dict[Foes, list[dict[str, Tally]]] = {foes: [] for foes in FOES}
    for k, part in enumerate(parts):
        held_out = parts[(k + 1) % folds]
        learn = samples.of(set(recordings) - set(part) - set(held_out))
        chosen, calibration = (one.select(settings.foes) for one in (learn, samples.of(held_out)))
        network = decider_of(train_network(chosen, calibration, replace(settings, seed=settings.seed + k)))
        for foes in FOES:
            tallies[foes].append(_tallies(network, learn.select(foes), samples.of(part).select(foes), part))
    return {foes: pooled(of_folds) for foes, of_folds in tallies.items()}


def _tallies(network: Decider, learn: GapSamples, judge: GapSamples, recordings: Sequence[str]) -> dict[str, Tally]:
    """What the network and the baselines, which learn first, get right."""
    deciders = {NETWORK: network} | {name: fit(learn) for name, fit in BASELINES.items()}
    return {name: tally(one, judge, recordings) for name, one in deciders.items()}


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    try:
        if options.folds and options.figure:
            raise ValueError("--figure shows one network, and with --folds there are several; leave one of them out")
        out = options.out / f"gap_{'folds' if options.folds else options.split}.json"
        check_outputs(out, options.figure)
        load = load_places if options.folds else partial(places_of, split=options.split)
        places = load(options.scenes, options.map)
        content: dict[str, Any] = {"bins": BINS, "resamples": RESAMPLES, "coverage": COVERAGE}
        if options.folds:
            samples = gap_samples(places)[0]
            content |= {"folds": options.folds, "foes": on_folds(samples, options.folds, GapSettings())}
        else:
            path = policy_path(options.policy)
            network = gap_network(PolicyFile.read(path))
            train, test = (
                gap_samples([place.select(split) for place in places])[0] for split in ("train", options.split)
            )
            content |= {"split": options.split, "policy": path.name, "foes": on_split(network, train, test)}
            if options.figure:
                _draw(network, test.select("all"), content["foes"], options.figure)
        print(measures_table(content["foes"]))
        write_result(out, content)
    except Interrupted as interrupt:
        print("interrupted; nothing written", file=sys.stderr)
        return interrupt.status
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _draw(network: GapNetwork, samples: GapSamples, by_foes: dict[str, Any], path: Path) -> None:
    curves, seen = acceptance_curves(network, samples), seen_gap(samples)
    write_figure(plot_acceptance(curves, EVEN, seen, by_foes), path)
