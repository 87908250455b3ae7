"""The report: our figures beside the paper's, as Markdown and as one HTML page with its pictures inside.

python -m experiments.report        from the results files, as `make reproduce` left them
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.report.headlines import headlines
from experiments.report.page import page
from experiments.report.summary import summary
from experiments.report.tables import (
    NAMES,
    closed_loop_table,
    default_table,
    errors_table,
    extrapolated_table,
    last_seen_table,
    order_handed_in_table,
    replay_table,
    report_table,
    until_last_seen_table,
)
from experiments.results_files import results_in
from experiments.show import ablations, forecast
from experiments.show.crossing_order import order_table
from experiments.show.driven_gain import driven_text
from experiments.show.gap import accuracy_table
from experiments.show.horizon import plot_errors
from experiments.show.maneuver_gain import gain_table, plot_gain
from experiments.show.perception import perception_text, plot_perception
from experiments.show.places import place_table
from experiments.show.runtime import plot_runtimes, runtimes_text
from experiments.show.validation_run import plot_accelerations
from intersection_env.files import written_whole
from intersection_env.plots.files import write_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Json = Mapping[str, Any]

DRIVERS = ("ppo", "gail", "rollout_gradient")
"""Whose accelerations are drawn."""
NOT_DRAWN = ("idm_critical_gap", "rollout_gradient_patience_kept")
"""Over the horizon: lines that would lie on others."""


def write_report(out: Path) -> None:
    """Writes summary.json, report.md, report.html and the figures (.svg, .pdf) into the folder of the results files.

    Raises:
        OSError: a results file cannot be read, or the report not written.
        ValueError: a results file is not JSON.
    """
    from matplotlib import rc_context

    results = results_in(out)
    about, seconds = (results["reproduced"][key] for key in ("about", "seconds"))
    _write(out / "summary.json", json.dumps(summary(results, about, seconds), indent=1) + "\n")
    # the same ids each time; and TrueType, as publishers refuse matplotlib's default, Type 3
    with rc_context({"svg.hashsalt": "report", "pdf.fonttype": 42}):
        for name, figure in _figures(results).items():
            for suffix in ("svg", "pdf"):
                write_figure(figure, out / "figures" / f"{name}.{suffix}")
    text = report(results, about, seconds)
    _write(out / "report.md", text)
    _write(out / "report.html", page(text, out))
    print(f"written: {out / 'summary.json'}, {out / 'report.md'}, {out / 'report.html'}")


def _figures(results: Json) -> dict[str, Figure]:
    horizon, run = results["horizon_validation"], results["closed_loop"]
    drawn = {one: name for one, name in NAMES.items() if one in horizon["models"] and one not in NOT_DRAWN}
    return {
        "horizon": plot_errors(horizon, drawn),
        "runtime": plot_runtimes(results["runtime"]),
        "maneuvers": plot_gain(results["maneuvers_validation"]),
        "reliability": forecast.plot_reliability(results["forecast_validation"]),
        "perception": plot_perception(results["perception_validation"]),
        "accelerations": plot_accelerations(
            run, {name: NAMES[name] for name in DRIVERS if name in run["acceleration"]}
        ),
    }


def report(results: Json, about: Json, seconds: Mapping[str, float]) -> str:
    """The report as Markdown."""
    rows = [row.cells() for row in headlines(results)]
    parts = [
        "# Every figure of the paper, re-run",
        _introduction(about, seconds),
        report_table(("figure", "paper, on inD", "ours, with 95 % interval", "bar", "command"), rows),
        *_sections(results),
        *_places(results["places"]),
        *_ablations(results.get("ablations")),
        "## Time taken\n\nOf trainings that were there before, what was left to do.",
        report_table(("stage", "s"), [(name, f"{taken:.0f}") for name, taken in seconds.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _introduction(about: Json, seconds: Mapping[str, float]) -> str:
    count = {key: len(about[f"recordings_{key}"]) for key in ("train", "development", "validation")}
    simulated = (
        " The recordings are **simulated with SUMO**: absolute figures on them cannot be compared with the paper's,"
        " which were measured on inD."
        if about["name"] == "simulated"
        else ""
    )
    return (
        f"`make reproduce`: {about['hours']:.1f} h of {about['name']} recordings, {count['train']} to learn from,"
        f" {count['development']} to choose by, {count['validation']} for this report.{simulated} Intervals hold"
        " 95 % of resamples of the validation recordings; differences and ratios are taken within each resample."
        " What each figure means is in `experiments/README.md`, how the paper was read where it is silent in"
        " `docs/model.md`."
        f" All stages took {sum(seconds.values()) / 60.0:.0f} min."
    )


def _sections(results: Json) -> Iterator[str]:
    validation, development = results["horizon_validation"], results["horizon_development"]
    yield "## Gap decisions\n\nAccuracy over frames [%], validation:"
    yield accuracy_table(results["gap_validation"])
    yield "## Crossing order\n\nValidation, no priorities assigned:"
    yield order_table(results["order_validation"])
    yield (
        "## Until last seen\n\nWho is recorded at the start and after 10 s is mostly who waited: who drives off has"
        " left the view. Here everyone recorded at the start counts, at the last moment within 10 s at which it is"
        " recorded (1 s later at least), validation:"
    )
    yield until_last_seen_table(validation)
    yield "By when they were last seen:"
    yield last_seen_table(validation)
    if "order_handed_in" in validation:
        yield (
            "With the recorded crossing order handed in, where it is known, so that what is left is not the gap"
            " decision's; where a prediction must refuse it (it contradicts the order in a lane, or what a vehicle can"
            " still do) nothing is handed in:"
        )
        yield order_handed_in_table(validation)
    yield "The same on development, with every seed:"
    yield until_last_seen_table(development)
    if "order_handed_in" in development:
        yield order_handed_in_table(development)
    yield (
        "The default policy is the one of least RMSE until last seen on development, of those that pass the gates"
        " (`intersection_env/evaluation/gates.py`):"
    )
    yield default_table(results["default"])
    yield "## Distance and time loss\n\nAfter 10 s, vehicles recorded at the start and then, validation:"
    yield errors_table(validation)
    yield "![Errors over the horizon](figures/horizon.svg)"
    if "at_4s" in validation:
        yield "The same after 4 s:"
        yield errors_table(validation, "at_4s")
    yield "Vehicles that are extrapolated at the start, built from their own future:"
    yield extrapolated_table(validation)
    yield "The same on development, by which all choices were made, with every seed:"
    yield errors_table(development)
    yield from _alone(results)
    yield from _forecasts(results)
    yield (
        "## Closed loop\n\n12 vehicles, 20 worlds for 2000 s each; drivers act by their mean, without limits. The"
        " rollout gradient's has never driven without them, and GAIL's pays next to nothing for a collision: both"
        " are drivers for predictions."
    )
    yield closed_loop_table(results["closed_loop"])
    yield "![Accelerations](figures/accelerations.svg)"
    yield "## Runtime\n\n```\n" + runtimes_text(results["runtime"]) + "\n```"
    yield "![Runtimes](figures/runtime.svg)"
    yield "## Maneuvers\n\nWhat the best safe crossing order saves against no intervention, validation:"
    yield gain_table(results["maneuvers_validation"])
    yield "![Gain over the share of cooperative vehicles](figures/maneuvers.svg)"
    if "driven_gain_validation" in results:
        yield "## Maneuvers driven\n\nSUMO drives on with the best safe order imposed and without, validation:"
        yield driven_text(results["driven_gain_validation"])


def _forecasts(results: Json) -> Iterator[str]:
    found = results["forecast_validation"]
    yield (
        f"## Forecasts\n\nProbabilities of crossing orders by the policy `{found['policy']}`, at all places,"
        " validation. *Not settled*: neither vehicle has reached the conflict at the start; log loss, Brier score and"
        " calibration error are of these. Gradient boosting has learned from the same features of the same pairs."
    )
    for population, of_pairs in found["orders"].items():
        yield f"Pairs: {population}. {of_pairs['pairs']} pairs, {of_pairs['open']} of them not settled at the start:"
        yield forecast.order_chances_table(of_pairs)
    yield "The order network at each place:"
    yield forecast.order_places_table(found["orders"])
    yield "![How often the yielder went first, over its probability](figures/reliability.svg)"
    yield "Where vehicles will be, over the orders and what drivers do within one:"
    yield forecast.positions_table(found["positions"])
    yield (
        "## Perception that errs\n\nPositions and speeds with normal errors, validation. Order and positions are held"
        " against the recording; the best maneuver of what was seen, against the best one of the traffic as it is."
    )
    yield perception_text(results["perception_validation"])
    yield "![What errors of perception do, over their size](figures/perception.svg)"


def _alone(results: Json) -> Iterator[str]:
    """Drivers alone."""
    yield (
        "Driving alone among recorded vehicles with the recorded order, as the drivers are, and kept within a"
        " prediction's limits, inside which the rollout gradient's learned; validation:"
    )
    yield replay_table(results["replay_validation"])
    yield "The same on development:"
    yield replay_table(results["replay_development"])


def _places(found: Json) -> Iterator[str]:
    """Each place by itself, if `make reproduce` has learned from several."""
    if len(found["validation"]) < 2:
        return
    yield "## Each place\n\nWhat is above is of the first. After 10 s, validation:"
    for name, of_place in found["validation"].items():
        yield f"**{name}**, {of_place['moments']} moments\n\n{place_table(of_place['rows'])}"


def _ablations(found: Json | None) -> Iterator[str]:
    """One thing changed at a time, if `make ablations` has run."""
    yield "## Ablations"
    if found is None:
        yield "Not run: `make ablations`."
        return
    yield (
        "One thing changed at a time, measured on development (`make ablations`); of which commit stands in "
        "experiments/README.md. Gap networks, calibrated IDM:"
    )
    yield ablations.gap_table(found["gap"])
    yield (
        "Drivers: alone among recorded vehicles with the recorded order, and predicting all jointly. Variants are "
        "trained with one seed, the first: what is smaller than the seeds differ by says nothing. Of each training the "
        "checkpoint counts that predicts development best; its error over 2 to 10 s stands beside the last one's."
    )
    yield ablations.gail_table(found["gail"])
    if "rollout_gradient" in found:
        yield (
            "Drivers of the rollout gradient, alone within a prediction's limits, inside which they learned, predicting"
            " all jointly, and with nobody else there. The last epoch counts."
        )
        yield ablations.rollout_table(found["rollout_gradient"])
    if found.get("left_out"):
        yield "At each place the driver that did not learn from it, beside the one that learned from all places:"
        yield ablations.left_out_table(found["left_out"])
    yield (
        "Whom to follow, in predictions by the driver of this report, which was trained with leads in its own lane; "
        f"{ablations.LEAD_MOMENTS} starts with an open conflict."
    )
    yield ablations.lead_table(found["lead"])


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the report anew from `experiments/results`; returns the exit status."""
    argparse.ArgumentParser(prog="python -m experiments.report", description=main.__doc__).parse_args(arguments)
    try:
        write_report(Path("experiments/results"))
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
