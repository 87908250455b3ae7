"""How driving networks do in the closed loop: the paper's run of 2000 s, a longer one, and how hard they accelerate.

python -m experiments.closed_loop
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import chi2
from tensordict import TensorDict
from tqdm import tqdm

from agents.networks.export import driving_network
from agents.rollouts.validation_run import STEPS, ValidationRun, validation_run
from agents.training.options import Maps
from experiments.measure.recorded import places_of
from experiments.results_files import check_outputs, write_result
from experiments.show.validation_run import plot_accelerations, runs_text
from imitation.expert import expert_steps
from intersection_env.constants import ACCELERATION
from intersection_env.evaluation.intervals import COVERAGE
from intersection_env.maps.intersection import Intersection
from intersection_env.plots.files import write_figure
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.places import PAPERS_SCENES
from intersection_env.worlds.life import Bodies

SEED = 2**41  # of no training
VEHICLES = 12
WORLDS = 20  # of the longer run
QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
EDGES = np.linspace(-ACCELERATION, ACCELERATION, 121)  # [m/s²] of the histogram


@dataclass(frozen=True)
class Options:
    """Driving networks in the closed loop."""

    scenes: tuple[Path, ...] = PAPERS_SCENES
    """Scenes that ship (names), or scenes files, on whose maps is driven, one after the other, and whose recorded
    accelerations stand beside."""
    map: Maps = ()
    """The maps (files) of scenes on maps that do not ship."""
    policies: tuple[str, ...] = ("ppo", "gail", "rollout_gradient")
    """Names of shipped policies, or policy files, with a driving network."""
    gaps: tuple[str, ...] = ("gap", "critical_gap")
    """Who decides about gaps, in turn."""
    bodies: Bodies = "circles"
    """By which vehicles collide: the paper's circles, or rectangles."""
    split: Literal["development", "validation"] = "development"
    """Whose recorded accelerations."""
    out: Path = Path("experiments/results")
    """The folder of the results file, "closed_loop.json"; of several places one each, "closed_loop_MAP.json"."""
    figure: Path | None = None
    """Where to draw the accelerations (.png, .svg, .pdf)."""


def closed_loop_results(
    predictors: Sequence[Predictor],
    gaps: Mapping[str, str],
    recorded: NDArray[np.float32],
    worlds: int = WORLDS,
    map: str | Path | Intersection = "bendplatz",
    bodies: Bodies = "circles",
) -> dict[str, Any]:
    """How these drivers do.

    Args:
        predictors: with a driving network each; it acts unlimited here, by its mean.
        gaps: who decides about gaps, in turn: what to call them, and what `ClosedLoopWorlds` calls them.
        recorded: (step,) accelerations of recorded vehicles [m/s²].
        worlds: of the longer run.
        map: where they drive.
        bodies: by which they collide.

    Returns:
        Under "drivers", by predictor and by who decides about gaps: the figures of one run of 2000 s and, under
        "longer", of so many worlds for 2000 s each, collisions there with an interval (exact, Poisson). Under
        "acceleration", by driver, quantiles and histogram over the longer run with the first of `gaps`; likewise
        "recorded".

    Raises:
        ValueError: a policy has no driving network.
    """
    drivers: dict[str, Any] = {}
    accelerations = {"recorded": _spread(recorded)}
    with tqdm(total=len(predictors) * len(gaps), desc="closed loop", disable=None) as bar:
        for predictor in predictors:
            policy = driving_network(predictor.policy)
            drivers[predictor.name] = {}
            for name, gap in gaps.items():
                seen: list[NDArray[np.floating]] = []

                def watch(data: TensorDict, seen: list[NDArray[np.floating]] = seen) -> None:
                    seen.append(ACCELERATION * torch.tanh(data["action"]).numpy().ravel())

                where: dict[str, Any] = {"map": map, "gap": gap, "vehicles": VEHICLES, "bodies": bodies}
                once = validation_run(policy, seed=SEED, **where)
                longer = validation_run(policy, seed=SEED, worlds=worlds, watch=watch, **where)
                drivers[predictor.name][name] = dataclasses.asdict(once) | {"longer": _longer(longer)}
                if predictor.name not in accelerations:
                    accelerations[predictor.name] = _spread(np.concatenate(seen))
                bar.update()
    return {"drivers": drivers, "quantiles": QUANTILES, "edges": EDGES.round(3).tolist(), "acceleration": accelerations}


def _longer(run: ValidationRun) -> dict[str, Any]:
    exposure = run.seconds * VEHICLES
    low, high = poisson_interval(round(run.collisions * exposure))
    interval = {"value": run.collisions, "low": low / exposure, "high": high / exposure}
    return dataclasses.asdict(run) | {"collisions": interval}


def poisson_interval(count: int) -> tuple[float, float]:
    """The means between which a Poisson count leaves no doubt at 95 %.

    Source: Garwood's exact interval.
    """
    tail = 0.5 * (1.0 - COVERAGE)
    low = 0.5 * float(chi2.ppf(tail, 2 * count)) if count else 0.0
    return low, 0.5 * float(chi2.ppf(1.0 - tail, 2 * count + 2))


def _spread(acceleration: NDArray[np.floating]) -> dict[str, list[float]]:
    counts, _ = np.histogram(acceleration, EDGES)
    quantiles = np.quantile(acceleration, QUANTILES).round(3)
    return {"quantiles": quantiles.tolist(), "histogram": (counts / counts.sum()).round(6).tolist()}


def main(options: Options) -> int:
    """Measures as told, prints the table, writes the results; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    try:
        if len(options.scenes) == 1:
            check_outputs(options.out / "closed_loop.json", options.figure)
        places = places_of(options.scenes, options.map, options.split)
        if options.figure and len(places) > 1:
            raise ValueError("--figure shows one place, and there are several --scenes; leave one of them out")
        outs = {
            place: options.out / f"closed_loop{'' if len(places) == 1 else f'_{place.intersection.name}'}.json"
            for place in places
        }
        for out in outs.values():
            check_outputs(out, options.figure)
        for place, out in outs.items():
            name = place.intersection.name
            results = closed_loop_results(
                [Predictor.load(one) for one in options.policies],
                dict(zip(options.gaps, options.gaps, strict=True)),
                expert_steps(place, options.split).acceleration,
                map=place.intersection,
                bodies=options.bodies,
            )
            print(f"{name}: {WORLDS} worlds of {VEHICLES} vehicles, {STEPS} steps\n{runs_text(results)}")
            if options.figure:
                write_figure(plot_accelerations(results, {one: one for one in results["drivers"]}), options.figure)
            write_result(out, results)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
