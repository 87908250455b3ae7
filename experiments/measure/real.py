"""Somebody's own recordings: every policy and rule that ships, scored on all of them, on one page.

python -m experiments.real --recordings RECORDINGS                    on the maps that ship
python -m experiments.real --recordings RECORDINGS --map mine.json    on one's own

Nothing is learned from the recordings, so all of them count, whatever their split. What cannot be scored, for there is
too little of it, is said on the page.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from agents.gap.baselines import BASELINES
from agents.gap.samples import GapSamples, gap_samples
from agents.networks.export import gap_network
from agents.training.options import Maps
from data.build import build, maps_of
from data.describe.statistics import describe, statistics
from experiments.measure.crossing_order import order_results
from experiments.measure.gap import decider_of
from experiments.measure.gap_scores import FOES, compare, tally
from experiments.report.page import page
from experiments.results_files import rows_of, write_result
from experiments.show.gap import NETWORK
from experiments.show.real import real_page
from intersection_env.constants import DT
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.moments import SCORED, moments_of
from intersection_env.files import check_writable, written_whole
from intersection_env.maps.intersection import Sample
from intersection_env.policies.file import PolicyFile
from intersection_env.policies.named import GAP_RULES, POLICIES
from intersection_env.prediction.predictor import Predictor
from intersection_env.scenes.scenes import Scenes

SHIPPED = Path("data/recordings")
UNTRAINED = ("always_wait", "critical_gap", "sumo", "sumo_kinematic")
"""Who decides about gaps without having learned from any."""


@dataclass(frozen=True)
class Options:
    """All that ships, scored on one's own recordings."""

    recordings: Path
    """The folder of the recordings: inD's, INTERACTION's or CommonRoad's."""
    map: Maps = ()
    """Maps (names, or files) of the places; none: each that ships and has recordings in the folder."""
    out: Path = Path("out/real")
    """The folder of the page, "real.md" and "real.html", its figures, "real.json", and the scenes files."""


def rules() -> list[Predictor]:
    """The rules that drive, the IDM with each rule that decides about gaps."""
    idm = [Predictor(PolicyFile(gap, "idm"), f"idm_{gap}") for gap in GAP_RULES]
    return [Predictor.load("constant_velocity"), *idm]


def shipped() -> list[Predictor]:
    """The policies that ship, those that only decide about gaps or calibrate first."""
    names = sorted(path.stem for path in POLICIES.glob("*.policy"))
    policies = [Predictor.load(name) for name in names]
    return sorted(policies, key=lambda one: one.policy.driver == "network")


def place_results(scenes: Scenes) -> dict[str, Any]:
    """What a place's scenes hold, and how all that ships does on them.

    Returns:
        `recordings`, `dropped`, `scenes`, `seconds` (of all scenes), `vehicles` by class; `traffic` (text), `speeds`,
        a row a route; `moments`, `refused`, `errors`, the rows of `evaluate`; `order`, as of `order_results`; `gaps`
        by foes, as of `compare`. What cannot be measured is {"missing": why}.
    """
    moments, refused = moments_of(scenes)
    models = [*rules(), *shipped()]
    learned = [one for one in models if not one.name.startswith("idm_") or one.name == "idm_calibrated"]
    classes = {track.id: track.road_user for scene in scenes for track in scene.tracks}
    return {
        "recordings": scenes.provenance["recordings"],
        "dropped": scenes.dropped,
        "scenes": len(scenes),
        "seconds": round(sum(scene.steps for scene in scenes) * DT, 1),
        "vehicles": dict(sorted(Counter(classes.values()).items())),
        "traffic": _or_why(lambda: {"text": describe(statistics(scenes), with_bars=False)})
        if len(scenes)
        else _no("no scene"),
        "speeds": speeds(scenes),
        "moments": len(moments),
        "refused": len(refused),
        "errors": [row for one in models for row in rows_of(evaluate(one, moments))] if moments else [],
        "order": _or_why(lambda: order_results(learned, moments)) if moments else _no("no moment to predict from"),
        "gaps": _gaps(scenes) if len(scenes) else dict.fromkeys(FOES, _no("no scene")),
    }


def speeds(scenes: Scenes) -> list[dict[str, Any]]:
    """Of cars and trucks in view, a row a route that somebody drives: how many, speeds and limits [m/s]."""
    found: dict[str, list[Any]] = {}
    for track in (track for scene in scenes for track in scene.tracks):
        if track.road_user in SCORED and track.observed.any():
            limit = scenes.intersection.sample(track.route, track.position[track.observed])[:, Sample.V_MAX]
            row = track.id, track.speed[track.observed], limit
            found.setdefault(scenes.intersection.routes[track.route].id, []).append(row)
    rows = []
    for route, driven in sorted(found.items()):
        speed = np.concatenate([one[1] for one in driven]).astype(np.float64)
        limit = np.concatenate([one[2] for one in driven]).astype(np.float64)
        quantiles = dict(zip(("median", "q85"), np.quantile(speed, (0.5, 0.85)).tolist(), strict=True))
        least, most = float(limit.min()), float(limit.max())
        vehicles = len({one[0] for one in driven})
        faster = float((speed > limit).mean())
        rows.append({"route": route, "vehicles": vehicles, **quantiles, "least": least, "most": most, "faster": faster})
    return rows


def _gaps(scenes: Scenes) -> dict[str, Any]:
    try:
        samples, _ = gap_samples(scenes)
    except ValueError as error:
        return dict.fromkeys(FOES, _no(str(error)))
    return {foes: _decided(samples.select(foes)) for foes in FOES}


def _decided(samples: GapSamples) -> dict[str, Any]:
    if not len(samples):
        return _no("no sample of which the recording shows who went first")
    network = decider_of(gap_network(PolicyFile.read(POLICIES / "gap.policy")))
    deciders = {NETWORK: network} | {name: BASELINES[name](samples) for name in UNTRAINED}
    recordings = sorted(set(samples.sample_recording.tolist()))
    return compare({name: tally(one, samples, recordings) for name, one in deciders.items()})


def _or_why(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    try:
        return work()
    except ValueError as error:
        return _no(str(error))


def _no(why: str) -> dict[str, Any]:
    return {"missing": why}


def main(options: Options) -> int:
    """Scores all that ships and writes the page; returns the exit status."""
    torch.set_num_threads(1)  # such small networks gain nothing from more
    try:
        check_writable(*(options.out / f"real.{name}" for name in ("json", "md", "html")))
        places: dict[str, Any] = {}
        for intersection in maps_of(options.recordings, options.map):
            scenes = build(options.recordings, intersection)
            if len(scenes):
                scenes.save(options.out / f"{intersection.name}.npz")
            places[intersection.name] = place_results(scenes)
        is_shipped = options.recordings.resolve() == SHIPPED.resolve()
        results = {"folder": str(options.recordings), "is_shipped": is_shipped, "places": places}
        write_result(options.out / "real.json", results)
        text = real_page(results)
        for name, content in (("md", text), ("html", page(text, options.out, "Own recordings"))):
            with written_whole(options.out / f"real.{name}") as temporary:
                temporary.write_text(content, encoding="utf-8")
        print(text)
        print(f"written: {options.out / 'real.md'}, {options.out / 'real.html'}, {options.out / 'real.json'}")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
