"""The report says what the results say, and its page needs no other file."""

from __future__ import annotations

import copy
import dataclasses
import importlib.util
import json
import os
import re
import shutil
from collections import Counter
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from agents.networks.driving import DrivingNetwork
from agents.networks.export import driving_policy
from agents.rollouts.validation_run import validation_run
from experiments.documentation.results import RESULTS as SHIPPED
from experiments.measure import perception, runtime, timed_calls
from experiments.measure import validation_run as closed_loop
from experiments.measure.crossing_order import order_results
from experiments.measure.forecast import figures_of
from experiments.measure.horizon import horizon_results
from experiments.measure.maneuver_gain import maneuver_results
from experiments.measure.runtime import runtime_results
from experiments.measure.validation_run import closed_loop_results
from experiments.report import report
from experiments.report.headlines import Row, headlines
from experiments.report.page import page
from experiments.report.report import write_report
from experiments.report.summary import MODELS, summary
from experiments.results_files import RESULTS
from experiments.show.crossing_order import POPULATIONS
from experiments.show.forecast import JOINT
from imitation.replay_error import ReplayError
from intersection_env import Intersection, Predictor
from intersection_env.evaluation import intervals
from intersection_env.evaluation.moments import contested, moments_of, thinned
from intersection_env.policies.named import gap_decider
from tests.experiments.measure.test_crossing_order import first, nobody_moves, pair, recordings_replayed
from tests.experiments.measure.test_forecast import chances
from tests.experiments.measure.test_horizon import made
from tests.experiments.measure.test_maneuver_gain import scenes_of

Results = dict[str, Any]
MEASURED = set(RESULTS)
LIKELY, MEAN = (f"rollout_gradient_{form}" for form in ("most_probable", "mean_over_orders"))
ALL = (*MODELS, "idm_critical_gap", "gail_0", "ppo_0", LIKELY, MEAN)
INFORMED = ("rollout_gradient", "gail", "idm_calibrated")
LIBSUMO = ("libsumo", "libsumo, steps alone")
ROW = {"vehicles": {"2": {"mean": 1.0, "median": 0.5, "calls": 3}, "3": {"mean": 2.0, "median": 1.5, "calls": 3}}}
ABOUT = {
    "name": "simulated",
    **{"recordings_train": ["00", "01"], "recordings_development": ["02"], "recordings_validation": ["03"]},
    "hours": 0.5,
}
SECONDS = {"scenes": 1.0, "ppo": 119.0}
VOID = {"meta", "br", "hr", "img"}


@pytest.fixture(scope="module")
def computed(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Small results of every kind, made as `make reproduce` makes them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(intervals, "RESAMPLES", 20)
        patch.setattr(closed_loop, "validation_run", partial(validation_run, steps=60))
        patch.setattr(runtime, "in_own_process", lambda *_: dict.fromkeys(LIBSUMO, ROW | {"doing": "its own"}))
        patch.setattr(runtime, "reference_rate", lambda: {"median": 80.0, "least": 79.0, "best": 81.0})
        for name, value in {"TORCH_SIZES": (2, 4), "TORCH_SCENES": 1, "TORCH_REPEATS": 1}.items():
            patch.setattr(runtime, name, value)
        patch.setattr(timed_calls, "WARM_UP", 1)
        torch.set_num_threads(1)
        gap = json.loads((SHIPPED / "gap_validation.json").read_text(encoding="utf-8"))
        results: Results = {f"gap_{split}": gap for split in ("development", "validation")}
        results |= {f"order_{split}": {"split": split, **_order()} for split in ("development", "validation")}
        results |= {f"horizon_{split}": {"split": split, **_horizon()} for split in ("development", "validation")}
        results |= {f"replay_{split}": _replay() for split in ("development", "validation")}
        results |= {f"forecast_{split}": {"split": split, **_forecast()} for split in ("development", "validation")}
        patch.setattr(perception, "SIZES", ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)))
        some = thinned(contested(moments_of(scenes_of(3))[0]), 3)
        results["perception_validation"] = perception.perception_results(Predictor.load("gap"), some, 0)
        results["maneuvers_validation"] = maneuver_results(
            Predictor.load("gap"), thinned(contested(moments_of(scenes_of(3))[0]), 9), 0
        )
        results["closed_loop"] = _closed_loop(tmp_path_factory.mktemp("policies"))
        results["runtime"] = runtime_results(runtime.Options(policy="ppo", scenes=2))
    results["default"] = _default()
    results["places"] = {"development": {}, "validation": {}}
    results["reproduced"] = {"about": ABOUT, "seconds": SECONDS}
    whole: Results = json.loads(json.dumps(results))
    assert set(whole) == MEASURED
    return whole


def _order() -> Results:
    bendplatz = Intersection.load("bendplatz")
    moments = first(bendplatz, *(pair(bendplatz, 30, 30 + k, f"{10 + k}") for k in (-5, -2, 3)))
    right = [recordings_replayed(moments, name) for name in ("gail", "ppo", "rollout_gradient")]
    wrong = nobody_moves(moments, "idm")
    return order_results([*right, wrong, Predictor(Predictor.load("gap").policy, "idm_calibrated")], moments)


def _horizon() -> Results:
    """The k-th model's errors are k+1 times those of the first; in the extrapolated population all is as large."""
    found = {
        name: made([1.0, -2.0, 3.0, 4.0], list("xxyy"), [True, True, True, False], scale=k + 1.0)
        for k, name in enumerate(ALL)
    }
    results = horizon_results(found)
    informed = {
        "until_last_seen": {name: results["until_last_seen"][name] for name in INFORMED},
        "models": {name: {"speed_behind": results["models"][name]["speed_behind"]} for name in INFORMED},
        "refused": dict.fromkeys(INFORMED, 1),
    }
    return {"moments": 4, "missing": {}, **results, "order_handed_in": informed}


def _replay() -> Results:
    row = dict.fromkeys(("at_4s", "at_10s"), dataclasses.asdict(ReplayError(5.0, 2.0, 100, 0.01, 0.002)))
    drivers = ("ppo", "ppo_0", "gail", "gail_0")
    freely = dict.fromkeys(("untrained", *drivers), row)
    return {"freely": freely, "within_limits": dict.fromkeys((*drivers, "rollout_gradient"), row)}


def _forecast() -> Results:
    """All models give the same chances."""
    pairs = figures_of(chances([0.9, 0.2, 0.6, 0.4], [True, False, False, False], [1, -1, 0, 1]), np.ones(4, np.bool_))
    orders = {population: {**pairs, "places": {"bendplatz": pairs}} for population in POPULATIONS}
    figure = {"value": 0.8, "low": 0.7, "high": 0.9}
    row = dict.fromkeys(("coverage", "crps", "median_error", "error_without_orders"), figure) | {"count": 4}
    positions = dict.fromkeys(("2", "4", "6", "8", "10", "until_last_seen"), row)
    return {"policy": "rollout_gradient", "orders": orders, "positions": positions}


def _default() -> Results:
    """The calibrated IDM is the default; GAIL stands."""
    errors = {"rmse": 2.0, "mad": 1.0, "bias": -0.5}
    row = {"until_last_seen": errors, "empty_road": 1.0, "disobeys": 0, "collisions": 0.01, "refusals": []}
    stands = row | {"empty_road": 0.0, "refusals": ["0.00 of the calibrated IDM's speed"]}
    policies = {"gap": row, "idm_calibrated": row, "ppo": row, "gail": stands}
    return {"default": "idm_calibrated", "policies": policies, "constant_velocity": errors}


def _closed_loop(folder: Path) -> Results:
    for name in report.DRIVERS:
        driving_policy(gap_decider("gap"), DrivingNetwork(), {}).save(folder / f"{name}.policy")
    drivers = [Predictor.load(folder / f"{name}.policy") for name in report.DRIVERS]
    gaps = {"gap": "gap", "critical_gap": "critical_gap"}
    recorded = np.array([-1.0, 0.0, 0.0, 1.0], np.float32)
    return closed_loop_results(drivers, gaps, recorded, worlds=2)


@pytest.fixture
def results(computed: Results) -> Results:
    """A copy that a test may change."""
    return copy.deepcopy(computed)


def written(results: Results, out: Path) -> Path:
    """The folder of a report on these results."""
    out.mkdir(exist_ok=True)
    for name, content in results.items():
        (out / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    write_report(out)
    return out


@pytest.fixture(scope="module")
def folder(computed: Results, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(computed, tmp_path_factory.mktemp("report"))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def keys_of(content: Results) -> dict[str, set[str]]:
    return {name: set(part) for name, part in content.items() if isinstance(part, dict)}


def test_summary_has_exactly_the_names_that_were_promised(folder: Path, computed: Results) -> None:
    content = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert keys_of(content) == {
        "data": {"name", "recordings_train", "recordings_validation", "hours"},
        "gap": {
            *("frame_accuracy", "balanced_accuracy", "pair_accuracy", "base_rate", "sumo_rule", "sumo_kinematic"),
            *("critical_gap", "logistic", "interval"),
        },
        "order": {"model", "rollout_gradient", "priority_first", "sumo_rule"},
        "distance": set(MODELS),
        "time_loss": set(MODELS),
        "until_last_seen": set(MODELS),
        "closed_loop": {"reward", "collisions_per_second_per_agent", "mean_speed", "duration_s"},
        "runtime": {"one_scenario_ms", "batch_ms", "maneuvers_per_cycle", "quadratic_ms", "isa"},
        "seconds": set(SECONDS),
    }
    assert MODELS == ("gail", "ppo", "rollout_gradient", "idm", "idm_calibrated", "constant_velocity", "sumo")
    assert all(set(row) == {"rmse_10s", "mad_10s"} for row in content["distance"].values())
    assert all(set(row) == {"rmse_10s", "q80_10s"} for row in content["time_loss"].values())
    assert all(set(row) == {"rmse", "mad", "bias"} for row in content["until_last_seen"].values())
    assert content["default"] == "idm_calibrated"
    assert content == summary(computed, ABOUT, SECONDS)


def test_summary_holds_the_figures_of_the_results(computed: Results) -> None:
    content = summary(computed, ABOUT, SECONDS)
    assert content["data"] == {key: ABOUT[key] for key in content["data"]}
    gap = json.loads((SHIPPED / "gap_validation.json").read_text(encoding="utf-8"))["foes"]["recorded"]
    for key, model in {"sumo_rule": "sumo", "critical_gap": "critical_gap", "logistic": "logistic"}.items():
        assert content["gap"][key] == gap["models"][model]["accuracy"]["value"]
    for key in ("balanced_accuracy", "pair_accuracy"):
        assert content["gap"][key] == gap["models"]["network"][key]["value"]
    network = gap["models"]["network"]["accuracy"]
    assert content["gap"]["frame_accuracy"] == network["value"]
    assert content["gap"]["interval"]["frame_accuracy"] == [network["low"], network["high"]]
    assert content["order"]["model"] == 1.0  # the recording itself
    assert content["order"]["priority_first"] == pytest.approx(2 / 3, abs=1e-3)
    once = np.sqrt(14.0 / 3.0)  # of 1, -2, 3
    for k, model in enumerate(MODELS):
        assert content["distance"][model] == pytest.approx({"rmse_10s": (k + 1) * once, "mad_10s": (k + 1) * 2.0})
        assert content["time_loss"][model] == pytest.approx(
            {"rmse_10s": (k + 1) * 0.1 * once, "q80_10s": (k + 1) * 0.26}
        )
        assert content["until_last_seen"][model] == pytest.approx(
            {"rmse": (k + 1) * once, "mad": (k + 1) * 2.0, "bias": (k + 1) * 2.0 / 3.0}
        )
    run = computed["closed_loop"]["drivers"]["ppo"]["gap"]
    assert content["closed_loop"]["reward"] == run["reward"]
    assert content["closed_loop"]["duration_s"] == 12.0
    times = computed["runtime"]["models"]["ours"]["vehicles"]
    assert content["runtime"]["one_scenario_ms"] == {size: row["mean"] for size, row in times.items()}
    assert content["seconds"] == SECONDS


GAP = ("gap_validation", "foes", "recorded", "models", "sumo", "network_minus", "accuracy")
ORDER = ("order_validation", "recorded", "models", "gail")
AT_10S = ("horizon_validation", "at_10s", "gail")
LAST = ("horizon_validation", "until_last_seen", "idm_calibrated")
RUN = ("closed_loop", "drivers", "ppo", "gap")
RUNTIME = ("runtime", "models", "ours", "vehicles", "15", "mean")
ROLLOUTS = ("rollout_gradient", "distance_rmse_to_idm_calibrated", "value")
ROLLOUTS_MAD = ("rollout_gradient", "distance_mad_to_idm_calibrated", "value")
ALONE = ("replay_validation", "within_limits", "rollout_gradient")
UNTIL = ("horizon_validation", "until_last_seen")
INFORMED_ROWS = ("horizon_validation", "order_handed_in", "until_last_seen")
AT_4S = ("horizon_validation", "at_4s")
BARS: dict[str, tuple[tuple[str, ...], float, float]] = {
    "rollout gradient, until last seen: RMSE to the calibrated IDM's": ((*UNTIL, *ROLLOUTS), 0.85, 0.86),
    "rollout gradient, until last seen: MAD to the calibrated IDM's": ((*UNTIL, *ROLLOUTS_MAD), 0.45, 0.46),
    "rollout gradient, until last seen, recorded order handed in: RMSE to the calibrated IDM's without it": (
        (*INFORMED_ROWS, "rollout_gradient", "distance_rmse", "value"),
        *(0.69, 0.71),
    ),
    "rollout gradient, at 4 s: RMSE to the calibrated IDM's": ((*AT_4S, *ROLLOUTS), 0.7, 0.71),
    "rollout gradient, at 4 s: MAD to the calibrated IDM's": ((*AT_4S, *ROLLOUTS_MAD), 0.4, 0.41),
    "rollout gradient, alone within limits, recorded order, 4 s: RMSE to GAIL's": (
        (*ALONE, "at_4s", "rmse"),
        2.25,
        2.3,
    ),
    "rollout gradient, alone within limits, recorded order, 10 s: RMSE to GAIL's": (
        (*ALONE, "at_10s", "rmse"),
        4.5,
        4.6,
    ),
    "network minus SUMO's rule": ((*GAP, "low"), 0.01, 0.0),
    "crossing order right": ((*ORDER, "accuracy", "value"), 0.836, 0.835),
    "that minus priority first": ((*ORDER, "minus", "priority_first", "value"), 0.01, 0.0),
    "that minus SUMO's rule": ((*ORDER, "minus", "sumo_rule", "value"), 0.01, -0.01),
    "time-loss RMSE at 10 s": ((*AT_10S, "time_loss_rmse", "value"), 1.2, 1.21),
    "... its RMSE to constant velocity's": ((*LAST, "distance_rmse_to_constant_velocity", "value"), 0.99, 1.0),
    "... its MAD to constant velocity's": ((*LAST, "distance_mad_to_constant_velocity", "value"), 0.99, 1.0),
    "PPO, 2000 s: mean reward": ((*RUN, "reward"), 0.4, 0.39),
    "... collisions a second and agent": ((*RUN, "collisions"), 0.00099, 0.001),
    "... mean speed": ((*RUN, "speed"), 6.0, 5.9),
    "15 vehicles, 10 s, one core": (RUNTIME, 3.4, 3.5),
    "maneuvers in 200 ms": (("runtime", "maneuvers_per_cycle"), 51, 50),
}
for _population in POPULATIONS:
    _of = ("forecast_validation", "orders", _population, "models", JOINT)
    _pairs = f"orders with probabilities, {_population} pairs"
    BARS |= {
        f"{_pairs}: right, minus SUMO's rule": ((*_of, "accuracy_minus_sumo", "low"), 0.01, 0.0),
        f"{_pairs}: right, minus priority first": ((*_of, "accuracy_minus_priority", "low"), 0.01, 0.0),
        f"{_pairs}: Brier score to gradient boosting's": ((*_of, "brier", "value"), 0.149, 0.15),
        f"{_pairs}: calibration error": ((*_of, "calibration_error", "value"), 0.03, 0.031),
    }
for _time in ("2", "4", "6", "8", "10"):
    _held = ("forecast_validation", "positions", _time, "coverage", "value")
    BARS[f"80 % interval of the position at {_time} s holds"] = (_held, 0.75, 0.74)
_TO_IDM, _OF_10S = ("distance_rmse_to_idm_calibrated", "value"), ("horizon_validation", "at_10s")
BARS |= {
    "most probable, 10 s: RMSE to the calibrated IDM's": ((*_OF_10S, LIKELY, *_TO_IDM), 0.8, 0.81),
    "most probable, 10 s: MAD to the calibrated IDM's": (
        (*_OF_10S, LIKELY, "distance_mad_to_idm_calibrated", "value"),
        *(0.8, 0.81),
    ),
    "most probable, 10 s: RMSE of the time loss": ((*_OF_10S, LIKELY, "time_loss_rmse", "value"), 1.2, 1.21),
    "most probable, until last seen: RMSE to the calibrated IDM's": ((*UNTIL, LIKELY, *_TO_IDM), 0.75, 0.76),
    "mean over orders, 10 s: RMSE to the calibrated IDM's": ((*_OF_10S, MEAN, *_TO_IDM), 0.7, 0.71),
    "mean over orders, until last seen: RMSE to the calibrated IDM's": ((*UNTIL, MEAN, *_TO_IDM), 0.75, 0.76),
}
"""By the figure's name: where it is in the results, a value that reaches the bar just so, and one that does not."""


def put(results: Results, path: tuple[str, ...], value: float) -> None:
    part: Any = results
    for key in path[:-1]:
        part = part[key]
    assert path[-1] in part
    part[path[-1]] = value


def row_of(results: Results, what: str) -> Row:
    (found,) = (row for row in headlines(results) if row.what == what)
    return found


@pytest.mark.parametrize("what", BARS)
def test_bar_is_met_or_missed_as_the_figure_demands(results: Results, what: str) -> None:
    path, good, bad = BARS[what]
    put(results, (*UNTIL, "idm_calibrated", "distance_rmse", "value"), 1.0)
    for value, met, said in ((good, True, ": met"), (bad, False, ": **missed**")):
        put(results, path, value)
        row = row_of(results, what)
        assert row.met is met
        assert row.cells()[3] == row.bar + said


@pytest.mark.parametrize(
    ("key", "other", "bar"),
    [("rmse", "idm", 0.6), ("rmse", "idm_calibrated", 0.8), ("mad", "idm", 0.8), ("mad", "idm_calibrated", 0.8)],
)
def test_bar_of_a_ratio_is_met_or_missed_as_the_figure_demands(
    results: Results, key: str, other: str, bar: float
) -> None:
    whose = {"idm": "the IDM's", "idm_calibrated": "the calibrated IDM's"}[other]
    what = f"... its {key.upper()} to {whose}"
    for value, met in ((bar, True), (bar + 0.01, False)):
        put(results, ("horizon_validation", "at_10s", "gail", f"distance_{key}_to_{other}", "value"), value)
        row = row_of(results, what)
        assert row.met is met
        assert row.ours.startswith(f"{value:.2f} [")


def test_every_bar_is_tried_above(results: Results) -> None:
    rows = list(headlines(results))
    ratios = [row for row in rows if row.what.startswith("... its ") and row.what.endswith(" IDM's")]
    assert len(ratios) == 4
    assert {row.what for row in rows if row.bar} == set(BARS) | {row.what for row in ratios}


def test_default_that_learned_to_drive_stands_beside_the_papers_driver_with_the_same_bars(results: Results) -> None:
    before = {row.what: row for row in headlines(results)}
    results["default"]["default"] = "rollout_gradient"
    put(results, (*AT_4S[:1], "at_10s", "rollout_gradient", "distance_rmse_to_idm", "value"), 0.5)
    rows = {row.what: row for row in headlines(results)}
    whose = ", default (rollout_gradient)"
    beside = {what.removesuffix(whose) for what in rows if what.endswith(whose)}
    assert beside == {
        *("crossing order right", "distance RMSE at 10 s", "distance MAD at 10 s", "time-loss RMSE at 10 s"),
        *(
            f"... its {figure} to {other}"
            for figure in ("RMSE", "MAD")
            for other in ("the IDM's", "the calibrated IDM's")
        ),
    }
    assert all(rows[what] == before[what] for what in beside), "the paper's driver's are as they were"
    assert all(rows[f"{what}{whose}"].bar == rows[what].bar for what in beside)
    assert rows[f"... its RMSE to the IDM's{whose}"].met
    assert rows["distance MAD at 10 s"].ours != rows[f"distance MAD at 10 s{whose}"].ours
    assert "until last seen, RMSE of the default (rollout_gradient)" in rows


def test_each_figure_has_a_command_that_is_there(computed: Results, folder: Path) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    for row in headlines(computed):
        match = re.fullmatch(
            r"make reproduce|python -m (experiments\.\w+)( --split validation)? --out out", row.command
        )
        assert match, row.command
        assert match[1] is None or importlib.util.find_spec(match[1])
        assert f"| {' | '.join(row.cells())} |" in text


class Page(HTMLParser):
    """What a page holds; raises where tags do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: Counter[str] = Counter()
        self.tags: Counter[str] = Counter()
        self.links: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        for name, value in attrs:
            if name == "id":
                self.ids[str(value)] += 1
            if name in ("src", "href", "xlink:href"):
                self.links.append(str(value))
            self.links += re.findall(r"url\(([^)]*)\)", value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" in self.open:
            assert "url(" not in data
            assert "@import" not in data
        else:
            self.words.append(data)


def test_page_needs_no_other_file_and_its_pictures_do_not_share_ids(folder: Path) -> None:
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert page.tags["svg"] == page.tags["figure"] == 6
    assert not page.tags["img"] + page.tags["script"] + page.tags["link"]
    assert [id for id, count in page.ids.items() if count > 1] == []
    assert len(page.links) > 100
    for link in page.links:
        assert link.startswith("#"), link
        assert link[1:] in page.ids, link


def test_page_and_markdown_say_the_same(folder: Path) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    words = " ".join(page.words)
    for line in text.splitlines():
        for cell in line.strip("|").split("|") if line.startswith("| ") else ():
            plain = cell.strip().replace("`", "").replace("**", "")
            assert all(part in words for part in plain.split(": ")) or set(plain) <= set("-"), plain


def test_pictures_lie_beside_the_markdown_and_fit_a_paper(folder: Path) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    pictures = [folder / name for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)]
    assert len(pictures) == 6
    for picture in pictures:
        assert picture.read_text(encoding="utf-8").startswith("<?xml")
        pdf = picture.with_suffix(".pdf").read_bytes()
        assert pdf.startswith(b"%PDF")
        assert b"/Type3" not in pdf
    assert {path.stem for path in pictures} == {path.stem for path in (folder / "figures").iterdir()}


def test_report_is_the_same_bytes_each_time(folder: Path) -> None:
    before = contents(folder)
    assert len(before) == len(MEASURED) + 3 + 12
    write_report(folder)
    after = contents(folder)
    assert {name for name in after if before.get(name) != after[name]} == set()


def test_model_that_is_missing_is_said_and_left_out(results: Results, folder: Path) -> None:
    for split in ("development", "validation"):
        found = results[f"horizon_{split}"]
        found["missing"] = {"sumo": "No module named 'sumo'"}
        for rows in ("models", "at_4s", "at_10s", "until_last_seen"):
            del found[rows]["sumo"]
    results["runtime"]["models"]["libsumo"] = {"missing": "not installed"}
    assert set(summary(results, ABOUT, SECONDS)["distance"]) == set(MODELS) - {"sumo"}
    assert set(summary(results, ABOUT, SECONDS)["time_loss"]) == set(MODELS) - {"sumo"}
    text = report.report(results, ABOUT, SECONDS)
    for one in (text, page(text, folder)):
        assert one.count("sumo: No module named 'sumo'.") == 3
        assert "libsumo: not installed" in one
    assert "| SUMO |" not in text


def test_what_was_not_measured_has_no_row_and_no_table(results: Results) -> None:
    whole = report.report(results, ABOUT, SECONDS)
    for split in ("development", "validation"):
        found = results[f"horizon_{split}"]
        for rows in ("models", "at_10s", "until_last_seen"):
            del found[rows]["rollout_gradient"]
        del found["at_4s"], found["order_handed_in"]
        for population in ("recorded", "all"):
            del results[f"order_{split}"][population]["models"]["rollout_gradient"]
    text = report.report(results, ABOUT, SECONDS)
    for said in ("The same after 4 s", "recorded order handed in", "alone within limits"):
        assert said in whole
        assert said not in text
    assert "rollout_gradient" not in summary(results, ABOUT, SECONDS)["order"]


def test_maneuvers_driven_are_in_the_report_where_they_were_measured(results: Results) -> None:
    assert "Maneuvers driven" not in report.report(results, ABOUT, SECONDS)
    results["driven_gain_validation"] = {"missing": {"sumo": "not installed"}}
    assert "Not driven: sumo: not installed." in report.report(results, ABOUT, SECONDS)


def test_figures_that_there_are_no_samples_of_are_left_out(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is extrapolated at the start where recordings are long and the map is small."""
    monkeypatch.setattr(intervals, "RESAMPLES", 20)
    known = made([1.0, -2.0, 3.0], list("xxy"))
    results["horizon_validation"] |= horizon_results(dict.fromkeys(ALL, known))
    text = report.report(results, ABOUT, SECONDS)
    begin = text.index("Vehicles that are extrapolated")
    assert len(text[begin : text.index("The same on development", begin)].strip().splitlines()) == 4  # and no row


def test_recordings_that_are_not_simulated_are_not_called_so(results: Results) -> None:
    text = report.report(results, ABOUT | {"name": "inD"}, SECONDS)
    assert "0.5 h of inD recordings, 2 to learn from, 1 to choose by, 1 for this report" in text
    assert "simulated" not in text


def test_file_that_cannot_be_written_leaves_the_old_ones_whole(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(folder)

    def full(path: str | Path, name: str | Path) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        write_report(folder)
    assert contents(folder) == before


def test_results_that_are_missing_or_malformed_are_an_error(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert report.main([]) == 1
    assert "gap_development.json" in capsys.readouterr().err
    out = tmp_path / "experiments" / "results"
    shutil.copytree(folder, out)
    (out / "runtime.json").write_text("{", encoding="utf-8")
    assert report.main([]) == 1
    assert "runtime.json: not JSON" in capsys.readouterr().err


def test_gap_figures_that_are_undefined_are_null_in_the_summary(results: Results) -> None:
    results["gap_validation"]["foes"]["recorded"]["models"]["network"]["balanced_accuracy"] = None
    assert summary(results, ABOUT, SECONDS)["gap"]["balanced_accuracy"] is None


def test_each_place_has_a_table_where_there_are_several(results: Results) -> None:
    row = {"model": "gail", "population": "recorded", "horizon": 10.0, "rmse": 7.25, "mad": 3.5, "count": 40}
    ours = {"moments": 12, "rows": [row, row | {"population": "another", "horizon": 8.0}, row | {"bias": 1.0}]}
    assert "Each place" not in report.report(results | {"places": {"validation": {"bendplatz": ours}}}, ABOUT, SECONDS)
    both = {"validation": {"bendplatz": ours, "mine": ours | {"moments": 13}}}
    text = report.report(results | {"places": both}, ABOUT, SECONDS)
    assert "**mine**, 13 moments" in text
    assert text.count("| recorded | gail | 7.25 | 3.50 | 40 |") == 4, "at the last horizon alone"
