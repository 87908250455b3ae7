"""What errors of perception do to crossing orders, positions and the choice of a maneuver.

python -m experiments.perception --figure out/perception.svg    on the development recordings
python -m experiments.perception --split validation             for the report, once

Each moment is seen once with errors of each size. A forecast takes that at its word, or knows by what it errs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from tqdm import tqdm

from experiments.measure.perception_choices import choices_of
from experiments.measure.perception_scores import Sample, figures_of, sample_of
from experiments.results_files import write_result
from experiments.show.perception import AWARE, UNAWARE, perception_text, plot_perception
from intersection_env.evaluation.moments import Moment, contested, thinned
from intersection_env.evaluation.places import moments_in
from intersection_env.plots.files import write_figure
from intersection_env.policies.named import DEFAULT
from intersection_env.prediction.forecast import TRIES, forecast
from intersection_env.prediction.noise import Noise, drawn
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES, load_places
from intersection_env.traffic import Traffic

STEPS = (0.25, 0.5, 1.0, 2.0)  # [m], [m/s]
SIZES = ((0.0, 0.0), *((a * x, b * x) for a, b in ((1, 0), (0, 1), (1, 1)) for x in STEPS))
"""Deviations of position [m] and speed [m/s]."""
MOMENTS = 300  # at most
DRAWS = 8  # of a forecast that knows of the errors


@dataclass(frozen=True)
class Options:
    """What errors of perception do."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, which `python -m data.build` makes; of one place or several."""
    map: tuple[str, ...] = ()
    """The maps (files) of scenes on maps that do not ship."""
    policy: str = DEFAULT
    """A policy that ships, or a policy file with an order network."""
    split: Literal["development", "validation"] = "development"
    """What to measure on; validation is for the report only."""
    moments: int = MOMENTS
    """How many at most, evenly spread over those with an open conflict."""
    seed: int = 0
    """Of the errors."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw what the errors do (.png, .svg, .pdf)."""


def perception_results(predictor: Predictor, moments: Sequence[Moment], seed: int) -> dict[str, Any]:
    """What errors of each of the `SIZES` do.

    Args:
        predictor: whose policy holds an order network.
        moments: each with an open conflict, as `contested` gives them.
        seed: of the errors, which are the same for all sizes but for the size.

    Returns:
        Beside what was measured, "sizes": one for each, with `position` and `speed`, and under "unaware" and, where
        something errs, "aware" the figures of `figures_of`.

    Raises:
        ValueError: no moments, or a policy without an order network.
    """
    if not moments:
        raise ValueError("no moments with an open conflict to see with errors")
    sizes = []
    for position, speed in tqdm(SIZES, desc="sizes", disable=None):
        samples: dict[str, list[Sample]] = {UNAWARE: [], AWARE: []}
        for number, moment in enumerate(moments):
            noise = Noise(position, speed, DRAWS, seed)
            seen = seen_with(moment.traffic, noise, np.random.default_rng((seed, number)))
            for name, sample in _samples(predictor, moment, seen, noise).items():
                samples[name].append(sample)
        figures = {name: figures_of(of) for name, of in samples.items() if of}
        sizes.append({"position": position, "speed": speed, **figures})
    return {
        "policy": predictor.name,
        "seed": seed,
        "draws": DRAWS,
        "moments": len(moments),
        "recordings": len({moment.scene.recording for moment in moments}),
        "sizes": sizes,
    }


def seen_with(traffic: Traffic, noise: Noise, generator: np.random.Generator) -> Traffic:
    """What is seen, with errors; drawn again where vehicles overlap.

    Raises:
        ValueError: they do in every draw.
    """
    refused = ""
    for _ in range(TRIES):
        try:
            return drawn(traffic, noise, generator)
        except ValueError as error:
            refused = str(error)
    raise ValueError(f"no traffic with such errors in {TRIES} draws; of the last one: {refused}")


def _samples(predictor: Predictor, moment: Moment, seen: Traffic, noise: Noise) -> dict[str, Sample]:
    """Of one moment as it is seen, by what the forecast knows."""
    plain = forecast(predictor, seen)
    if noise.position == noise.speed == 0.0:
        choice = choices_of(predictor, moment.traffic, seen, None)
        return {UNAWARE: sample_of(moment, plain, choice[UNAWARE])}
    careful = forecast(predictor, seen, noise=noise)
    choices = choices_of(predictor, moment.traffic, seen, noise)
    return {
        UNAWARE: sample_of(moment, plain, choices[UNAWARE]),
        AWARE: sample_of(moment, careful, choices[AWARE]),
    }


def main(options: Options) -> int:
    """Measures as told, prints the tables, writes the results; returns the exit status."""
    try:
        moments, _ = moments_in(load_places(options.scenes, options.map), options.split)
        chosen = thinned(contested(moments), options.moments)
        results = perception_results(Predictor.load(options.policy), chosen, options.seed)
        print(perception_text(results))
        if options.figure:
            write_figure(plot_perception(results), options.figure)
        write_result(options.out / f"perception_{options.split}.json", {"split": options.split, **results})
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
