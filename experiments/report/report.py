"""The report: our figures beside the paper's, as Markdown and as one HTML page with its pictures inside.

python -m experiments.report        from the results files, as `make reproduce` left them
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import markdown
from matplotlib import rc_context

from experiments.documentation.results import gap_table
from experiments.measure import crossing_order, horizon, maneuver_gain
from experiments.measure import validation_run as closed_loop
from experiments.report.headlines import headlines, in_unit
from experiments.report.summary import summary
from experiments.reproduce import ablations
from experiments.results_files import results_in
from experiments.show import runtime as runtime_figure
from intersection_env.files import written_whole
from intersection_env.plots.files import write_figure

NAMES = {
    "gail": "GAIL",
    "ppo": "PPO",
    "idm": "IDM (paper)",
    "idm_calibrated": "IDM, calibrated",
    "constant_velocity": "constant velocity",
    "idm_critical_gap": "IDM, critical gaps",
    "sumo": "SUMO",
}
ERRORS = ("distance_rmse", "distance_mad", "time_loss_rmse", "time_loss_q80")
STYLE = """
:root { color-scheme: light dark; --ink: #1d1d1b; --page: #fff; --line: #ddd; --quiet: #f3f3f0; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e2; --page: #1b1b1a; --line: #444; --quiet: #2b2b29; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--page); max-width: 76rem;
  margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.5rem; } p { max-width: 46rem; }
table { border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; font-size: 14px; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem 1rem .3rem 0; text-align: left; vertical-align: top;
  white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; }
td:first-child { position: sticky; left: 0; background: var(--page); white-space: normal; min-width: 11rem; }
code { background: var(--quiet); padding: 0 .2rem; font-size: .9em; }
td code { padding: 0; background: none; }
pre { background: var(--quiet); padding: .7rem; overflow-x: auto; font-size: 13px; line-height: 1.4; }
pre code { padding: 0; background: none; font-size: inherit; }
figure { margin: 1rem 0; } svg { max-width: 100%; height: auto; background: #fff; }
"""

Json = Mapping[str, Any]


def write_report(out: Path) -> None:
    """Writes summary.json, report.md, report.html and the figures (.svg, .pdf) into the folder of the results files.

    Raises:
        OSError: a results file cannot be read, or the report not written.
        ValueError: a results file is not JSON.
    """
    results = results_in(out)
    about, seconds = (results["reproduced"][key] for key in ("about", "seconds"))
    _write(out / "summary.json", json.dumps(summary(results, about, seconds), indent=1) + "\n")
    pictures = {
        "horizon": horizon.plot(results["horizon_validation"], _drawn(results["horizon_validation"])),
        "runtime": runtime_figure.plot(results["runtime"]),
        "maneuvers": maneuver_gain.plot(results["maneuvers_validation"]),
        "accelerations": closed_loop.plot(results["closed_loop"], {name: NAMES[name] for name in ("ppo", "gail")}),
    }
    # the same ids each time; and TrueType, as publishers refuse matplotlib's default, Type 3
    with rc_context({"svg.hashsalt": "report", "pdf.fonttype": 42}):
        for name, figure in pictures.items():
            for suffix in ("svg", "pdf"):
                write_figure(figure, out / "figures" / f"{name}.{suffix}")
    text = report(results, about, seconds)
    _write(out / "report.md", text)
    _write(out / "report.html", page(text, out))
    print(f"written: {out / 'summary.json'}, {out / 'report.md'}, {out / 'report.html'}")


def report(results: Json, about: Json, seconds: Mapping[str, float]) -> str:
    """The report as Markdown."""
    rows = [row.cells() for row in headlines(results)]
    parts = [
        "# Every figure of the paper, re-run",
        _introduction(about, seconds),
        _table(("figure", "paper, on inD", "ours, with 95 % interval", "bar", "command"), rows),
        *_sections(results),
        *_ablations(results.get("ablations")),
        "## Time taken",
        _table(("stage", "s"), [(name, f"{taken:.0f}") for name, taken in seconds.items()]),
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
        " What each figure means, and how the paper was read where it is silent, is in `experiments/README.md`."
        f" All stages took {sum(seconds.values()) / 60.0:.0f} min."
    )


def _sections(results: Json) -> Iterator[str]:
    validation, development = results["horizon_validation"], results["horizon_development"]
    yield "## Gap decisions\n\nAccuracy over frames [%], validation:"
    yield gap_table(results["gap_validation"])
    yield "## Crossing order\n\nValidation, no priorities assigned:"
    yield crossing_order.table(results["order_validation"])
    yield "## Distance and time loss\n\nAfter 10 s, vehicles recorded at the start and then, validation:"
    yield _errors_table(validation)
    yield "![Errors over the horizon](figures/horizon.svg)"
    yield "Vehicles that are extrapolated at the start, built from their own future:"
    yield _extrapolated_table(validation)
    yield "The same on development, by which all choices were made, with every seed:"
    yield _errors_table(development)
    yield "Driving alone among recorded vehicles with the recorded order, development:"
    yield _replay_table(results["replay_development"])
    yield "## Closed loop\n\n12 vehicles, 20 worlds for 2000 s each; drivers act by their mean, without limits:"
    yield _closed_loop_table(results["closed_loop"])
    yield "![Accelerations](figures/accelerations.svg)"
    yield "## Runtime\n\n```\n" + runtime_figure.table(results["runtime"]) + "\n```"
    yield "![Runtimes](figures/runtime.svg)"
    yield "## Maneuvers\n\nWhat the best safe crossing order saves against no intervention, validation:"
    yield maneuver_gain.table(results["maneuvers_validation"])
    yield "![Gain over the share of cooperative vehicles](figures/maneuvers.svg)"


def _ablations(found: Json | None) -> Iterator[str]:
    """One thing changed at a time, if `make ablations` has run."""
    yield "## Ablations"
    if found is None:
        yield "Not run: `make ablations`."
        return
    yield "One thing changed at a time, measured on development (`make ablations`). Gap networks, calibrated IDM:"
    yield ablations.gap_table(found["gap"])
    yield (
        "Drivers: alone among recorded vehicles with the recorded order, and predicting all jointly. Variants are "
        "trained with one seed, the first: what is smaller than the seeds differ by says nothing. Of each training the "
        "checkpoint counts that predicts development best; its error over 2 to 10 s stands beside the last one's."
    )
    yield ablations.gail_table(found["gail"])
    yield (
        "Whom to follow, in predictions by the driver of this report, which was trained with leads in its own lane; "
        f"{ablations.LEAD_MOMENTS} starts with an open conflict."
    )
    yield ablations.lead_table(found["lead"])


def _called(name: str) -> str:
    """A model's name in a table; `gail_1` is GAIL's with seed 1."""
    model, _, seed = name.rpartition("_")
    return f"{NAMES[model]}, seed {seed}" if model in NAMES and seed.isdecimal() else NAMES.get(name, name)


def _errors_table(found: Json) -> str:
    heads = ("", "RMSE [m]", "MAD [m]", "time loss RMSE [s]", "80 % [s]", "RMSE to calibrated IDM's")
    rows = []
    for name, row in found["at_10s"].items():
        ratio = row.get("distance_rmse_to_idm_calibrated")
        rows.append((_called(name), *(in_unit(row[key]) for key in ERRORS), in_unit(ratio) if ratio else ""))
    return _table(heads, rows) + "".join(f"\n\n{name}: {why}." for name, why in found["missing"].items())


def _extrapolated_table(found: Json) -> str:
    rows = []
    for name in (one for one in NAMES if one in found["models"]):
        curves = found["models"][name]["extrapolated"]
        if not curves["count"][-1]:
            continue
        figures = [curves["distance"]["rmse"], curves["distance"]["mad"], curves["time_loss"]["rmse"]]
        rows.append((NAMES[name], *(f"{one[-1]:.2f}" for one in figures), str(curves["count"][-1])))
    return _table(("", "RMSE [m]", "MAD [m]", "time loss RMSE [s]", "samples"), rows)


def _replay_table(found: Json) -> str:
    heads = ("", "RMSE [m]", "MAD [m]", "vehicles", "collided", "line run, of held steps")
    rows = [
        (
            _called(name),
            *(f"{row[key]:.2f}" for key in ("rmse", "mad")),
            str(row["count"]),
            *(f"{100.0 * row[key]:.2f} %" for key in ("collisions", "line_runs")),
        )
        for name, row in found.items()
    ]
    return _table(heads, rows)


def _closed_loop_table(found: Json) -> str:
    rows = []
    for name, of_driver in found["drivers"].items():
        for gap, run in of_driver.items():
            longer = run["longer"]
            spread = longer["collisions"]
            collisions = f"{spread['value']:.1e} [{spread['low']:.1e}, {spread['high']:.1e}]"
            figures = [f"{longer[key]:.2f}" for key in ("reward", "reward_between_collisions")]
            rows.append((_called(name), gap, *figures, collisions, f"{longer['speed']:.1f}"))
    heads = ("", "gaps by", "reward", "between collisions", "collisions a second and agent", "speed [m/s]")
    return _table(heads, rows)


def _drawn(found: Json) -> dict[str, str]:
    return {model: name for model, name in NAMES.items() if model in found["models"] and model != "idm_critical_gap"}


def _table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def page(text: str, folder: Path) -> str:
    """The report as an HTML page that needs no other file; pictures are taken from the folder.

    Raises:
        OSError: a picture cannot be read.
    """
    body = markdown.markdown(text, extensions=["tables", "fenced_code"])

    def picture(found: re.Match[str]) -> str:
        file = folder / found[2]
        svg = file.read_text(encoding="utf-8")
        own = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{file.stem}-", svg[svg.index("<svg") :])  # not another figure's
        return f'<figure role="img" aria-label="{found[1]}">{own}</figure>'

    body = re.sub(r'<p><img alt="([^"]*)" src="([^"]*)" /></p>', picture, body)
    return (
        f'<!doctype html>\n<html lang="en">\n<head><meta charset="utf-8"><title>intersection_env: report</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n'
        f"<body>\n{body}\n</body></html>\n"
    )


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main() -> int:
    """Writes the report anew from `experiments/results`; returns the exit status."""
    try:
        write_report(Path("experiments/results"))
    except (OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
