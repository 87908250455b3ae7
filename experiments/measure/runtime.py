"""How long the next 10 s of 2 to 15 vehicles take to predict, over random scenes, as in the paper's runtime figure.

python -m experiments.runtime --figure out/runtime.pdf

On one core, from Python: time losses and smallest distances, no trajectories. The call counts, building the traffic
does not. Machines are noisy: compare within one run.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from experiments.bench.own_process import in_own_process
from experiments.bench.predictor import CYCLE, SIZES
from experiments.bench.stopwatch import reference_rate
from experiments.bench.timed_traffic import random_traffics
from experiments.measure import runtime_libsumo
from experiments.measure.timed_calls import Times, milliseconds, model_row
from experiments.results_files import check_outputs, write_result
from experiments.show.runtime import plot_runtimes, runtimes_text
from intersection_env import Predictor, Traffic, _core
from intersection_env.plots.files import write_figure
from intersection_env.policies.file import PolicyFile
from intersection_env.traffic import FLOAT_FIELDS

BATCH = 64  # scenarios a call
TURN = 100  # scenes, of one case
TORCH_SIZES, TORCH_SCENES, TORCH_REPEATS = (2, 5, 10, 15), 10, 3
PAPER = {"vehicles": 15, "ms": 3.5, "maneuvers_per_cycle": 50, "core": "AMD Ryzen 7 3700X"}
"""An upper bound of one prediction's time and a lower one of what fits in a cycle. Source: paper, Section IV-C.3."""

Case = Callable[[Traffic], Callable[[], object]]
"""For a traffic, the call that is timed."""


@dataclass(frozen=True)
class Options:
    """Runtimes over the number of vehicles."""

    policy: str = "rollout_gradient"
    """A policy file with both networks, or the name of a shipped one."""
    scenes: int = 2000
    """How many random scenes for each number of vehicles."""
    seed: int = 0
    """Of the scenes."""
    out: Path = Path("experiments/results")
    """The folder of the results file."""
    figure: Path | None = None
    """Where to draw the runtimes (.png, .svg, .pdf)."""


def runtime_results(options: Options) -> dict[str, Any]:
    """All of it, as the results file holds it.

    Raises:
        ValueError: no scenes, an unknown policy, or one without both networks.
        OSError: the policy file cannot be read.
    """
    if options.scenes < 1:
        raise ValueError(f"--scenes is {options.scenes}; wanted at least 1")
    ours, idm = Predictor.load(options.policy, threads=1), Predictor.load("idm", threads=1)
    if ours.policy.gap_network is None or ours.policy.driving_network is None:
        raise ValueError(f'the policy "{options.policy}" lacks a network; wanted one with both')
    cases = {"ours": _one(ours), "ours, batch": _batch(ours), "IDM": _one(idm), "IDM, batch": _batch(idm)}
    reference = [reference_rate()]
    results: dict[str, Any] = {"policy": ours.name, "scenes": options.scenes, "seed": options.seed, "batch": BATCH}
    results |= {"steps": _core.STEPS, "cores": os.cpu_count(), "isa": _core.kernel_name()} | core_times(cases, options)
    results["reference_gflops"] = [*reference, reference_rate()]
    models = results["models"]
    libsumo = in_own_process(runtime_libsumo.__name__, "libsumo")
    models |= {name: libsumo.get(name, libsumo) for name in ("libsumo", "libsumo, steps alone")}  # or why it is missing
    models["torch"] = torch_times(ours.policy, options.seed)
    results["fits"] = {name: fits(models[name]) for name in ("ours", "ours, batch")}
    results["maneuvers_per_cycle"] = int(CYCLE * 1e3 / models["ours, batch"]["vehicles"][str(SIZES[-1])]["mean"])
    return results | {"paper": PAPER}


def random_scenes(count: int, seed: int) -> Iterator[dict[int, Traffic]]:
    """So many random traffics of 15 vehicles, and by number of vehicles so many of them; the same ones for a seed.

    Each number has one vehicle more than the one before, so that curves over it do not jump with the luck of a draw.
    """
    generator = np.random.default_rng(seed)
    for traffic in islice(random_traffics(generator), count):
        drawn = generator.permutation(len(traffic))
        yield {size: _some(traffic, sorted(drawn[:size].tolist())) for size in SIZES}


def _some(traffic: Traffic, kept: list[int]) -> Traffic:
    ids = tuple(traffic.ids[k] for k in kept)
    columns = {name: getattr(traffic, name)[kept] for name in FLOAT_FIELDS}
    return Traffic(traffic.intersection, ids, traffic.route[kept], **columns)


def _one(predictor: Predictor) -> Case:
    return lambda traffic: lambda: predictor.predict(traffic, trajectories=False)


def _batch(predictor: Predictor) -> Case:
    """A batch that leaves all to the gap decision, which takes longest; its scenarios are alike, each by itself."""

    def case(traffic: Traffic) -> Callable[[], object]:
        assignments = np.zeros((BATCH, len(traffic.conflicts)), np.int8)
        bound = predictor.bound_to(traffic.intersection)
        return lambda: bound.summarize(traffic.core, assignments, True, apart=True)

    return case


def core_times(cases: Mapping[str, Case], options: Options) -> dict[str, Any]:
    """Each case's times, the mean number of pairs by number of vehicles, and how much of a core there was.

    Cases and numbers take turns, so many scenes each, so that a machine that slows down slows all of them alike.
    """
    taken: dict[str, Times] = {name: {size: [] for size in SIZES} for name in cases}
    pairs, wall, work = dict.fromkeys(SIZES, 0), 0.0, 0.0
    scenes = random_scenes(options.scenes, options.seed)
    with tqdm(total=options.scenes, desc="runtime", unit="scene", disable=None) as bar:
        while turn := list(islice(scenes, TURN)):
            begin, begin_of_work = time.perf_counter(), time.process_time()
            for size in SIZES:
                traffics = [scene[size] for scene in turn]
                pairs[size] += sum(len(traffic.conflicts) for traffic in traffics)
                for name, case in cases.items():
                    taken[name][size] += milliseconds([case(traffic) for traffic in traffics])
            wall, work = wall + time.perf_counter() - begin, work + time.process_time() - begin_of_work
            bar.update(len(turn))
    models = {
        name: model_row(times, "one call a scene", BATCH if name.endswith("batch") else 1)
        for name, times in taken.items()
    }
    means = {str(size): count / options.scenes for size, count in pairs.items()}
    return {"models": models, "pairs": means, "core_share": work / wall}


def fits(model: Mapping[str, Any]) -> dict[str, Any]:
    """By statistic and kind of polynomial; medians as well, which others on the machine disturb less."""
    found = {}
    for statistic in ("mean", "median"):
        times = {int(size): row[statistic] for size, row in model["vehicles"].items()}
        found[statistic] = {kind: fit(times, degree) for degree, kind in ((1, "linear"), (2, "quadratic"))}
    return found


def fit(times: Mapping[int, float], degree: int) -> dict[str, Any]:
    """The least-squares polynomial: its coefficients, the constant first, and what share of the variance it explains.

    Args:
        times: by number of vehicles.
    """
    sizes, values = np.array(list(times), float), np.array(list(times.values()))
    coefficients = np.polynomial.polynomial.polyfit(sizes, values, degree)
    rest = values - np.polynomial.polynomial.polyval(sizes, coefficients)
    return {"coefficients": coefficients.tolist(), "explained": float(1.0 - rest.var() / values.var())}


def torch_times(policy: PolicyFile, seed: int) -> dict[str, Any]:
    """The same model as plain torch operations, one scenario, of a few scenes and numbers of vehicles."""
    import torch

    from imitation.torch_model import TorchPredictor

    torch.set_num_threads(1)
    times: Times = {size: [] for size in TORCH_SIZES}
    for scene in random_scenes(TORCH_SCENES, seed):
        for size in TORCH_SIZES:
            predictor = TorchPredictor.of(scene[size], policy)
            assignment = torch.zeros((1, len(scene[size].conflicts)), dtype=torch.int8)
            times[size] += milliseconds([partial(predictor.predict, assignment)] * TORCH_REPEATS)
    return model_row(times, f"{TORCH_SCENES} scenes, {TORCH_REPEATS} times each")


def main(options: Options) -> int:
    """Times as told, prints the table, writes the results and the figure; returns the exit status."""
    out = options.out / "runtime.json"
    try:
        check_outputs(out, options.figure)
        results = runtime_results(options)
        print(runtimes_text(results))
        write_result(out, results)
        if options.figure:
            from matplotlib import rc_context

            with rc_context({"pdf.fonttype": 42}):  # TrueType; publishers refuse matplotlib's default, Type 3
                write_figure(plot_runtimes(results), options.figure)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
