"""What an agent sees, drawn on a map: the paper's illustration of its features, with what the core measures.

python -m experiments.documentation.features --out docs/pictures/features.png
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from experiments.show.style import BLUE, RED
from intersection_env import Intersection, Predictor, Traffic, Vehicle
from intersection_env.command import run_command
from intersection_env.features import Driving, Gap
from intersection_env.maps.intersection import Sample
from intersection_env.plots.colours import INK
from intersection_env.plots.files import write_figure
from intersection_env.plots.lanes import draw_lanes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TURN = "#2f8257"
HALO = 2.5  # [point], white around letters


class Who(IntEnum):
    """The vehicles that are drawn: the one that sees, the one ahead of it, and one with priority."""

    OWN = 0
    LEAD = 1
    FOE = 2


PLACE = slice(Sample.X, Sample.HEADING)
COLOURS = {Who.OWN: BLUE, Who.LEAD: "#6d6d69", Who.FOE: RED}


def figure() -> Any:
    """The figure: one vehicle that has to yield, the one ahead of it, and one that has priority."""
    from matplotlib.figure import Figure

    bendplatz = Intersection.load("bendplatz")
    own, main = (bendplatz.routes[bendplatz.route_index(id)] for id in ("SW-NW", "NW-SE"))
    traffic = Traffic.of(
        bendplatz,
        [
            Vehicle("own", own.id, own.stop_line - 15.0, 6.0),
            Vehicle("lead", own.id, own.stop_line - 4.0, 2.0),
            Vehicle("foe", main.id, main.stop_line - 21.0, 12.0),
        ],
    )
    left, right = Figure(figsize=(11.6, 6.4), layout="constrained").subplots(1, 2, width_ratios=(1.0, 1.0))
    turning = Traffic.of(bendplatz, [Vehicle("own", own.id, own.stop_line - 1.0, 4.0)])
    for axes, shown in ((left, traffic), (right, turning)):
        draw_lanes(axes, bendplatz)
        for who in list(Who)[: len(shown)]:
            _draw_path(axes, shown, who)
            _draw_vehicle(axes, shown, who, COLOURS[who])
    _draw_distances(left, traffic)
    _frame(left, [_pose(traffic, vehicle, float(traffic.position[vehicle])) for vehicle in (Who.OWN, Who.FOE)], 16.0)
    left.set_title("distances, speeds and the gap decision", fontsize=11)
    _draw_headings(right, turning)
    ahead = [_pose(turning, Who.OWN, float(turning.position[Who.OWN]) + offset) for offset in (-10.0, 30.0, 100.0)]
    _frame(right, ahead, 9.0)
    right.set_title("the road's heading, relative to that here", fontsize=11)
    return left.figure


def _draw_distances(axes: Axes, traffic: Traffic) -> None:
    """The distances as the core measures them, each laid along the route from where it begins."""
    own, lead, foe = (COLOURS[who] for who in Who)
    seen = Predictor.load("idm").observe(traffic)
    gap = seen.gap[traffic.conflicts.tolist().index([Who.OWN, Who.FOE])]
    driving = seen.driving[Who.OWN]
    half = 0.5 * traffic.length
    front, rear = (float(traffic.position[Who.OWN] + way * half[Who.OWN]) for way in (1, -1))
    foe_front = float(traffic.position[Who.FOE] + half[Who.FOE])
    for who, begin, distance, aside, name, colour in (
        (Who.OWN, front, driving[Driving.DISTANCE_TO_STOP_LINE], -3.2, "stop", own),
        (Who.OWN, front, driving[Driving.LEAD_DISTANCE], 2.9, "lead", lead),
        (Who.OWN, rear, gap[Gap.DISTANCE_TO_PGA], -6.4, "PGA", own),
        (Who.FOE, foe_front, gap[Gap.FOE_DISTANCE_TO_STOP_LINE], -3.2, "stop", foe),
    ):
        text = f"$d_{{{name}}}$ = {distance:.1f} m"
        _measure(axes, traffic, who, begin, begin + float(distance), aside, text, colour)
    enters, v_max = driving[Driving.ENTERS], driving[Driving.V_MAX]
    state = f"v = {driving[Driving.SPEED]:.0f} m/s\n$v_{{max}}$ = {v_max * 3.6:.0f} km/h"
    _note(axes, traffic, Who.OWN, f"{state}\nδ = {enters:.0f}: {'enters' if enters else 'has to wait'}", own, 14.0)
    _note(axes, traffic, Who.LEAD, f"$v_{{lead}}$ = {driving[Driving.LEAD_SPEED]:.0f} m/s", lead, -3.5)
    _note(axes, traffic, Who.FOE, f"has priority\nv = {gap[Gap.FOE_SPEED]:.0f} m/s", foe, -4.0)


def _draw_headings(axes: Axes, traffic: Traffic) -> None:
    """The road's heading at six offsets, relative to that where the vehicle is."""
    seen = Predictor.load("idm").observe(traffic).driving[Who.OWN, Driving.HEADINGS : Driving.LEAD_DISTANCE]
    position = float(traffic.position[Who.OWN])
    _, _, here = _pose(traffic, Who.OWN, position)
    for offset, relative in zip(traffic.intersection.core.heading_offsets, seen.tolist(), strict=True):
        x, y, heading = _pose(traffic, Who.OWN, position + offset)
        to_x, to_y = x + 4.0 * np.cos(here + relative), y + 4.0 * np.sin(here + relative)
        axes.plot(x, y, "o", markersize=3.5, color=TURN, zorder=6.0)
        arrow = {"arrowstyle": "-|>", "color": TURN, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", xy=(to_x, to_y), xytext=(x, y), arrowprops=arrow, zorder=6.0)
        aside_x, aside_y = -2.2 * np.sin(heading), 2.2 * np.cos(heading)
        text = f"{offset:+.0f} m: {round(np.degrees(relative))}°"
        _write(axes, x + aside_x, y + aside_y, text, TURN, "right" if aside_x < 0.0 else "left", 7.5)


def _measure(
    axes: Axes, traffic: Traffic, vehicle: int, begin: float, end: float, aside: float, text: str, colour: str
) -> None:
    """A dimension line along a vehicle's route between two arc lengths, `aside` metres to its left."""
    along = np.array([_pose(traffic, vehicle, at) for at in np.linspace(begin, end, 60)])
    left = np.stack([-np.sin(along[:, Sample.HEADING]), np.cos(along[:, Sample.HEADING])], axis=1)
    places = along[:, PLACE]
    line = places + aside * left
    axes.plot(*line.T, color=colour, linewidth=1.3, zorder=5.0)
    for index in (0, -1):
        axes.plot(
            *np.stack([places[index], line[index] + 0.12 * (line[index] - places[index])]).T,
            color=colour,
            linewidth=0.7,
            zorder=4.9,
        )
    middle = line[len(line) // 2] + np.sign(aside) * 1.0 * left[len(line) // 2]
    _write(axes, middle[0], middle[1], text, colour, "left" if np.sign(aside) * left[30, 0] > 0.0 else "right", 9.0)


def _draw_vehicle(axes: Axes, traffic: Traffic, vehicle: int, colour: str) -> None:
    x, y, heading = _pose(traffic, vehicle, float(traffic.position[vehicle]))
    half = 0.5 * np.array([traffic.length[vehicle], traffic.width[vehicle]])
    corners = half * np.array([(-1, -1), (0.75, -1), (1, -0.55), (1, 0.55), (0.75, 1), (-1, 1)])
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    axes.fill(*(corners @ turn + (x, y)).T, facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=5.5)


def _draw_path(axes: Axes, traffic: Traffic, vehicle: int) -> None:
    """A vehicle's route and its stop line."""
    route = traffic.intersection.routes[traffic.route[vehicle]]
    x, y, heading = _pose(traffic, vehicle, route.stop_line)
    left = 1.4 * np.array([-np.sin(heading), np.cos(heading)])
    axes.plot([x - left[0], x + left[0]], [y - left[1], y + left[1]], color=INK, linewidth=2.4, zorder=4.0)
    path = np.array([_pose(traffic, vehicle, at) for at in np.linspace(0.0, route.length, 400)])
    axes.plot(*path[:, PLACE].T, color="#a9a9a5", linewidth=0.9, linestyle=(0, (4.0, 2.0)), zorder=2.0)


def _note(axes: Axes, traffic: Traffic, vehicle: int, text: str, colour: str, right: float) -> None:
    x, y, heading = _pose(traffic, vehicle, float(traffic.position[vehicle]))
    aside = right * np.array([np.sin(heading), -np.cos(heading)])
    _write(axes, x + aside[0], y + aside[1], text, colour, "left" if aside[0] > 0.0 else "right", 9.0)


def _write(axes: Axes, x: float, y: float, text: str, colour: str, align: str, size: float) -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=HALO, foreground="white")]
    axes.text(x, y, text, color=colour, fontsize=size, ha=align, va="center", path_effects=halo, zorder=7.0)


def _pose(traffic: Traffic, vehicle: int, position: float) -> NDArray[np.float64]:
    """x, y [m] and heading [rad] at an arc length of a vehicle's route."""
    sample = traffic.intersection.sample(int(traffic.route[vehicle]), np.array([position], np.float32))
    return np.asarray(sample[0, Sample.X : Sample.WIDTH], dtype=np.float64)


def _frame(axes: Axes, poses: Sequence[NDArray[np.float64]], margin: float) -> None:
    """A square that holds these places and `margin` metres beside them."""
    places = np.array(poses)[:, PLACE]
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    half = 0.5 * float(np.ptp(places, axis=0).max()) + margin
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.tick_params(labelsize=8)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draws the figure into a file."""
    parser = argparse.ArgumentParser(prog="python -m experiments.documentation.features", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the picture to write")
    options = parser.parse_args(arguments)
    write_figure(figure(), options.out)
    print(f"written: {options.out}")


if __name__ == "__main__":
    run_command(main)
