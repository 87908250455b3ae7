"""What the scenes hold, as figures that a person can compare with real traffic.

python -m data.describe.statistics bendplatz t_junction
python -m data.describe.statistics mine.npz --map mine.json
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.describe.gaps import LONGEST_GAP, critical_gap, offered_gaps, open_pairs
from data.describe.real import BENDPLATZ
from data.describe.speeds import STANDING, Spread, slowest_in_junction, speed_behind_junction
from data.pipeline.filters import together, touchings
from data.pipeline.shared_lanes import overlap_length, pair_gap
from data.sumo import places as simulated
from intersection_env.command import run_command
from intersection_env.constants import DT
from intersection_env.scenes.places import load_places
from intersection_env.scenes.scenes import Scenes

LEAST_PAIRS = 400.0  # [1/h], ours: fewer are too few decisions to learn from in the hours that ship
CRITICAL_GAP = (4.0, 7.0)  # [s], ours: about the Highway Capacity Manual's 4.1 to 7.1 s


@dataclass(frozen=True)
class Statistics:
    """The figures; see `describe` for their units."""

    hours: float
    vehicles: dict[str, int]
    motor_vehicles_per_hour: float
    pairs_per_hour: float
    yielder_first: float
    gaps_per_hour: float
    gaps_accepted: float
    critical_gap: tuple[float, float] | None
    """Half of all accept it, and the width from 10 to 90 % acceptance."""
    standing: tuple[float, float] | None
    """Mean and 90 % quantile; None without a vehicle from a side road."""
    mean_speed: float
    slowest: dict[str, Spread | None]
    """In the junction, by turn."""
    behind: Spread | None
    """Speed behind the junction."""
    acceleration_p1: float
    acceleration_p99: float
    smallest_gap: float
    overlapping: int

    @property
    def meets_bars(self) -> bool:
        """Whether gap acceptance can be learned: enough pairs, a usual critical gap, nobody overlaps."""
        enough = self.pairs_per_hour >= LEAST_PAIRS
        usual = self.critical_gap is not None and CRITICAL_GAP[0] <= self.critical_gap[0] <= CRITICAL_GAP[1]
        return enough and usual and self.overlapping == 0


def statistics(scenes: Scenes) -> Statistics:
    """The figures of all given scenes together."""
    hours = sum(scene.steps for scene in scenes) * DT / 3600.0
    vehicles = {track.id: track.road_user for scene in scenes for track in scene.tracks}
    pairs = [pair for scene in scenes for pair in open_pairs(scene, scenes.intersection)]
    gaps = [gap for scene in scenes for gap in offered_gaps(scene, scenes.intersection)]
    seconds = np.array([gap.seconds for gap in gaps])
    accepted = np.array([gap.accepted for gap in gaps], dtype=np.float64)
    standing = np.array(list(_standing_times(scenes).values()))
    tracks = [track for scene in scenes for track in scene.tracks if track.observed.any()]
    speed = np.concatenate([track.speed[track.observed] for track in tracks])
    acceleration = np.concatenate([track.acceleration[track.observed] for track in tracks])
    smallest, overlapping = _closeness(scenes)
    return Statistics(
        hours=hours,
        vehicles=dict(sorted(Counter(vehicles.values()).items())),
        motor_vehicles_per_hour=sum(kind != "bicycle" for kind in vehicles.values()) / hours,
        pairs_per_hour=len(pairs) / hours,
        yielder_first=sum(pair.yielder_first for pair in pairs) / max(len(pairs), 1),
        gaps_per_hour=len(gaps) / hours,
        gaps_accepted=float(accepted.sum()) / max(len(gaps), 1),
        critical_gap=critical_gap(seconds, accepted),
        standing=(float(standing.mean()), float(np.quantile(standing, 0.9))) if len(standing) else None,
        mean_speed=float(speed.mean(dtype=np.float64)),
        slowest=slowest_in_junction(scenes),
        behind=speed_behind_junction(scenes),
        acceleration_p1=float(np.quantile(acceleration, 0.01)),
        acceleration_p99=float(np.quantile(acceleration, 0.99)),
        smallest_gap=smallest,
        overlapping=overlapping,
    )


def describe(figures: Statistics, with_bars: bool = True) -> str:
    """The figures as text, one a line: here, real ones, and the bars that the recordings that ship must reach."""
    vehicles = ", ".join(f"{count} {road_user}" for road_user, count in figures.vehicles.items())
    critical, width = (f"{value:.1f} s" for value in figures.critical_gap) if figures.critical_gap else ("none",) * 2
    standing = "mean {:.1f} s, p90 {:.1f} s".format(*figures.standing) if figures.standing else "none"
    rows = {
        "traffic in scenes": f"{figures.hours:.2f} h",
        "vehicles": vehicles,
        "cars and trucks": f"{figures.motor_vehicles_per_hour:.0f} an hour",
        "unled yield/priority pairs": f"{figures.pairs_per_hour:.0f} an hour",
        "yielder goes first": f"{100.0 * figures.yielder_first:.0f} %",
        f"gaps of {LONGEST_GAP:g} s or less": f"{figures.gaps_per_hour:.0f} an hour",
        "gaps accepted": f"{100.0 * figures.gaps_accepted:.0f} %",
        "critical gap": critical,
        "its 10-90 % width": width,
        "side-road standing time": standing,
        "mean speed in view": f"{figures.mean_speed:.1f} m/s",
        **{f"slowest in junction, {turn}": _speeds(one) for turn, one in figures.slowest.items()},
        "speed behind the junction": _speeds(figures.behind),
        "acceleration 1 %, 99 %": f"{figures.acceleration_p1:+.1f}, {figures.acceleration_p99:+.1f} m/s²",
        "smallest bumper gap": f"{figures.smallest_gap:.2f} m",
        "overlapping vehicles": str(figures.overlapping),
        "all bars reached": "yes" if figures.meets_bars else "NO",
    }
    bars = {
        "unled yield/priority pairs": f"at least {LEAST_PAIRS:.0f}",
        "critical gap": f"{CRITICAL_GAP[0]:g} to {CRITICAL_GAP[1]:g} s",
        "overlapping vehicles": "0",
    }
    heads = ["", "here", "real Bendplatz", "bar"]
    table = [heads, *([name, text, BENDPLATZ.get(name, ""), bars.get(name, "")] for name, text in rows.items())]
    if not with_bars:
        table = [row[:3] for row in table[:-1]]
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
    )


def _is_stand_in(scenes: Scenes) -> bool:
    """Whether they are of the simulated recordings of Bendplatz, for which the bars are."""
    return all(one["location"] == simulated.BENDPLATZ.location for one in scenes.provenance["recordings"])


def _speeds(spread: Spread | None) -> str:
    if spread is None:
        return "too few vehicles"
    return f"{spread.median:.1f} m/s ({spread.low:.1f} to {spread.high:.1f}, {spread.vehicles} vehicles)"


def _standing_times(scenes: Scenes) -> dict[str, float]:
    """Seconds that each vehicle stood before its line, for vehicles that come from arms without priority."""
    routes = scenes.intersection.routes
    yielding = {conflict.yielder for conflict in scenes.intersection.conflicts}
    arms = {route.id.partition("-")[0] for route in routes}
    major = {arm for arm in arms if any(r.id.startswith(f"{arm}-") and r.index not in yielding for r in routes)}
    times: dict[str, float] = {}
    for scene in scenes:
        for track in scene.tracks:
            route = routes[track.route]
            if route.id.partition("-")[0] not in major and track.observed.any():
                before = track.observed & (track.position < route.first_conflict)
                times[track.id] = times.get(track.id, 0.0) + DT * int((track.speed[before] < STANDING).sum())
    return times


def _closeness(scenes: Scenes) -> tuple[float, int]:
    """The smallest bumper gap in a shared lane [m], and how many overlaps and touches there are."""
    smallest, overlapping = float("inf"), 0
    for scene in scenes:
        overlapping += len(touchings(scene.tracks, scenes.intersection))
        for first, second in together(scene.tracks):
            gap = pair_gap(first, second, scenes.intersection)
            if gap is not None:
                least = float(np.abs(gap.ahead).min()) - overlap_length(first, second)
                smallest = min(smallest, least)
                overlapping += least < 0.0
    return smallest, overlapping


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the figures of a scenes file and returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m data.describe.statistics", description="Figures of a scenes file.")
    parser.add_argument("scenes", nargs="+", help="scenes that ship (names), or scenes files")
    parser.add_argument("--map", nargs="+", default=(), help="the maps (files) of scenes on maps that do not ship")
    options = parser.parse_args(arguments)
    try:
        places = load_places(options.scenes, options.map)
        for name, scenes in zip(options.scenes, places, strict=True):
            if not len(scenes):
                raise ValueError(f"{name}: holds no scene")
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    for name, scenes in zip(options.scenes, places, strict=True):
        title = f"{name}, map {scenes.intersection.name}"
        print(f"{title}\n{'-' * len(title)}\n{describe(statistics(scenes), _is_stand_in(scenes))}\n")
    return 0


if __name__ == "__main__":
    run_command(main)
