"""From recordings to a ranked list of maneuvers, and to what predictions of them are worth.

python -m experiments.demo --recordings data/recordings --map bendplatz --out out/demo
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from data.build import build, recordings_on
from data.pipeline.split import split_of
from intersection_env.command import run_command
from intersection_env.evaluation.errors import evaluate
from intersection_env.evaluation.moments import Moment, moments_of
from intersection_env.files import check_writable, written_whole
from intersection_env.maps.intersection import Intersection
from intersection_env.plots.animation import animate
from intersection_env.plots.files import write_figure
from intersection_env.plots.forecast_plot import plot_forecast
from intersection_env.plots.prediction_plot import plot_positions, short_ids
from intersection_env.prediction.forecast import forecast
from intersection_env.prediction.maneuvers import COUNT_LIMIT, WORTHWHILE_GAIN, rank_maneuvers
from intersection_env.prediction.predictor import Prediction, Predictor
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic

MODELS = ("constant_velocity", "idm", "gap", "idm_calibrated", "ppo", "gail", "rollout_gradient")
ROWS = 10
FILES = ("scenes.npz", "forecast.png", "positions.png", "animation.gif", "errors.csv")
"""What is written, in this order."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the demo and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m experiments.demo", description="The main job, end to end.")
    parser.add_argument("--recordings", type=Path, default=Path("data/recordings"), help="folder of recordings")
    parser.add_argument("--map", default="bendplatz", help="a shipped map's name, or the path of a .json or .map")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="the folder to write to")
    options = parser.parse_args(arguments)
    begin = time.perf_counter()
    try:
        check_writable(*(options.out / name for name in FILES))
        scenes = _build(options.recordings, Intersection.load(options.map), options.out / "scenes.npz")
        moments = _moments(scenes)
        _rank(busiest(moments), Predictor.load(), options.out)
        _evaluate(scenes, moments, options.out / "errors.csv")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"\ndone in {time.perf_counter() - begin:.0f} s")
    return 0


def busiest(moments: Sequence[Moment]) -> Moment:
    """The moment with the most open conflicts between recorded vehicles, if its scene lasts 10 s from there.

    Conflicts with a vehicle extrapolated into the past do not count: it comes from its own future. Of several
    moments the first.

    Raises:
        ValueError: from none of them.
    """
    full = [moment for moment in moments if moment.full]
    if not full:
        raise ValueError("no scene lasts 10 s from any of its moments: nothing to rank maneuvers at")
    return max(full, key=_recorded_conflicts)


def _recorded_conflicts(moment: Moment) -> int:
    return int(_recorded_now(moment)[moment.traffic.conflicts].all(axis=1).sum())


def _recorded_now(moment: Moment) -> NDArray[np.bool_]:
    """(vehicle,), those that are not extrapolated into the past."""
    now: NDArray[np.bool_] = ~np.ma.getmaskarray(moment.recorded)[0]
    return now


def _build(folder: Path, intersection: Intersection, path: Path) -> Scenes:
    """The development scenes; the other recordings are not read."""
    _heading("1. Scenes from recordings")
    present, elsewhere = recordings_on(folder, intersection)
    split, _ = split_of(folder, present)
    chosen = [id for id in present if split[id] == "development"]
    if not chosen:
        raise ValueError(f"{folder}: none of its {len(present)} recordings is for development; three or more have one")
    print(f"map {intersection.name}; {folder}: {len(present)} recordings, of which those for development are read")
    if elsewhere:
        print(f"  not on this map: {len(elsewhere)} recordings of other locations")
    begin = time.perf_counter()
    scenes = build(folder, intersection, chosen)
    hours = sum(one["seconds"] for one in scenes.provenance["recordings"]) / 3600.0
    vehicles = len({track.id for scene in scenes for track in scene.tracks})
    minutes = sum(scene.duration for scene in scenes) / 60.0
    print(
        f"recordings {', '.join(chosen)}: {hours:.2f} h in {time.perf_counter() - begin:.1f} s,"
        f" {len(scenes)} scenes with {vehicles} vehicles over {minutes:.1f} min"
    )
    for reason, count in scenes.dropped.items():
        print(f"  dropped or cut: {reason:<48} {count:>8g}")
    if not len(scenes):
        raise ValueError(f"{folder}: recordings {', '.join(chosen)} leave no stretch to make a scene of")
    scenes.save(path)
    _written(path)
    return scenes


def _moments(scenes: Scenes) -> list[Moment]:
    moments, refused = moments_of(scenes)
    print(f"{len(moments)} moments, one a second; {len(refused)} more left out because vehicles overlap in them")
    for moment, why in list(refused.items())[:3]:
        print(f"  {moment}: {why}")
    return moments


def _rank(moment: Moment, predictor: Predictor, out: Path) -> None:
    traffic = moment.traffic
    _heading("2. The busiest moment")
    print(
        f"scene {moment.scene.id}, {moment.time:.0f} s after its begin: {_recorded_conflicts(moment)} open conflicts"
        " among recorded vehicles, the most\nof any moment whose scene lasts 10 s from there (the first, if several);"
        f" {len(traffic.conflicts)} with those extrapolated into the past"
    )
    print(_vehicles(moment).to_string(index=False))
    _heading(f"3. Crossing orders, predicted 10 s ahead ({predictor.name})")
    begin = time.perf_counter()
    table = rank_maneuvers(predictor, traffic)
    milliseconds = 1e3 * (time.perf_counter() - begin)
    orders = int(table["intervention"].sum())
    print(
        f"{orders} feasible orders predicted and ranked in {milliseconds:.0f} ms;"
        f" {_left_out(table.attrs['left_out'])} left out"
    )
    print(_ranking(table, traffic))
    print(_verdict(table))
    found = forecast(predictor, traffic)
    print(f"the most probable order, without intervention ({found.probability[0]:.0%}): {found.words()[0]}")
    write_figure(plot_forecast(found), out / "forecast.png")
    _written(out / "forecast.png")
    default = predictor.predict(traffic)
    interventions = table[table["intervention"]]
    best = predictor.predict(traffic, interventions["priorities"].iloc[0]) if orders else default
    name = "best order" if interventions["safe"].any() else "least bad order (unsafe)"
    _draw(moment, default, name, best, out)


def _draw(moment: Moment, default: Prediction, name: str, best: Prediction, out: Path) -> None:
    none, first = (
        f"{title}: {prediction.time_loss.sum():.1f} s lost"
        for title, prediction in (("no intervention", default), (name, best))
    )
    write_figure(plot_positions(default, best, moment.recorded, (none, first)), out / "positions.png")
    _written(out / "positions.png")
    animate({none: default, first: best}, out / "animation.gif")
    _written(out / "animation.gif")


def _evaluate(scenes: Scenes, moments: Sequence[Moment], path: Path) -> None:
    _heading("4. Errors over the development scenes")
    print(
        f"predicted from {len(moments)} moments of {len(scenes)} scenes, all vehicles jointly; cars and trucks scored\n"
        "until_last_seen: all recorded at the start, each at the last moment within 10 s at which it is recorded;"
        " last_seen: of\nthose the ones last seen within the 2 s up to the horizon; recorded: at the start and at the"
        " horizon, so mostly who waited;\nextrapolated: not yet seen at the start, so built from their own future\n"
        "distance along the route [m] and time loss [s], predicted minus recorded; speeds behind the junction [m/s]"
    )
    table = pd.concat([evaluate(Predictor.load(model), moments) for model in MODELS], ignore_index=True)
    shown = table.sort_values(["population", "model", "horizon"], ascending=[False, True, True])
    print(shown.to_string(index=False, float_format=lambda value: f"{value:.2f}"))
    text = table.to_csv(index=False, float_format="%.6g")
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    _written(path)


def _vehicles(moment: Moment) -> pd.DataFrame:
    traffic = moment.traffic
    routes = [traffic.intersection.routes[index] for index in traffic.route]
    front = traffic.position + traffic.length / 2
    conflicts = [int((traffic.conflicts == i).any(axis=1).sum()) for i in range(len(traffic))]
    return pd.DataFrame(
        {
            "vehicle": traffic.ids,
            "recorded": np.where(_recorded_now(moment), "yes", "no"),
            "class": [track.road_user for track in moment.tracks()],
            "route": [route.id for route in routes],
            "to stop line [m]": [f"{route.stop_line - s:.1f}" for route, s in zip(routes, front, strict=True)],
            "speed [m/s]": [f"{v:.1f}" for v in traffic.speed],
            "conflicts": conflicts,
        }
    )


def _ranking(table: pd.DataFrame, traffic: Traffic) -> str:
    """The first rows and the one of no intervention, as text; vehicles without their recording."""
    table = table.assign(rank=range(1, len(table) + 1))
    shown = pd.concat([table.head(ROWS), table[~table["intervention"]]]).drop_duplicates("rank")
    short = dict(zip(traffic.ids, short_ids(traffic), strict=True))
    words = [", ".join(short.get(one, one) for one in order.split(", ")) for order in shown["order"]]
    yes = {True: "yes", False: "no"}
    text = pd.DataFrame(
        {
            "rank": shown["rank"],
            "time loss [s]": shown["total_time_loss"].map("{:.2f}".format),
            "worst [s]": shown["worst_time_loss"].map("{:.2f}".format),
            "gain [s]": shown["gain"].map("{:+.2f}".format),
            "distance [m]": shown["minimum_distance"].map("{:.2f}".format),
            "followed": shown["followed"].map(yes),
            "safe": shown["safe"].map(yes),
            "worth it": shown["worth_executing"].map(yes),
            "order": words,
        }
    )
    return text.to_string(index=False, formatters={"order": lambda order: f"  {order}"}, justify="right")


def _verdict(table: pd.DataFrame) -> str:
    first = table[table["safe"] & table["intervention"]].head(1)
    if first.empty:
        return "no safe order to intervene with"
    gain = float(first["gain"].iloc[0])
    worth = "worth" if first["worth_executing"].iloc[0] else "not worth"
    return f"the best safe order saves {gain:.2f} s: {worth} an intervention (it takes more than {WORTHWHILE_GAIN:g} s)"


def _left_out(count: int) -> str:
    return f"{COUNT_LIMIT} or more" if count >= COUNT_LIMIT else str(count)


def _heading(text: str) -> None:
    print(f"\n{text}\n{'-' * len(text)}")


def _written(path: Path) -> None:
    print(f"written: {path}")


if __name__ == "__main__":
    run_command(main)
