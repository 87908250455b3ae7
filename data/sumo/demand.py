"""Who drives through a simulated recording, when, where to and in what temper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from data.sumo.network import CORNERING
from data.sumo.places import Place
from intersection_env.maps.source import MapSource

BLOCK = 180.0  # [s], ours: traffic comes denser and thinner in blocks this long
BLOCK_SPREAD = 0.35  # ours: standard deviation of the logarithm of a block's demand
BICYCLE_FLOW = 30.0  # [1/h] in all
TRUCK_SHARE = 0.04
BICYCLE_WIDTH = 0.65  # [m]
KINDS = ("car", "truck_bus", "bicycle")
WIDER_PACE = -0.35, 0.1  # ours: a speed limit is often guessed, or kept to differently from place to place
TURNS = {"main": {"straight": 0.66, "left": 0.17, "right": 0.17}, "side": {"straight": 0.4, "left": 0.3, "right": 0.3}}


class Stream(NamedTuple):
    """A route as demand sees it: from which arm, main or side, and how it turns."""

    route: str
    entry: str
    road: str
    turn: str


@dataclass(frozen=True)
class Driver:
    """A vehicle and its driver: departure [s], length and width [m], SUMO's vehicle class and vType attributes."""

    id: str
    depart: float
    route: str
    kind: str
    v_class: str
    length: float
    width: float
    traits: dict[str, float]
    arrival: float | None = None
    """Where on its last edge the trip ends [m]; None: at its end."""


@dataclass(frozen=True)
class Temper:
    """How the drivers of a recording differ, from each other and from those of other recordings."""

    spread: float = 1.0
    """Times the spread of every trait, and how far its limits lie from its mean."""
    pace: float = 1.0
    """Times the share of the speed limit at which all of them like to drive."""


USUAL = Temper()


def wider(rng: np.random.Generator, times: float) -> Temper:
    """Draw the temper of one recording of many that differ `times` as much; 1 is the usual one."""
    slower, faster = WIDER_PACE
    return Temper(times, float(1.0 + (times - 1.0) * rng.uniform(slower, faster)))


def main_arms(source: MapSource) -> set[str]:
    """The arms of the main road."""
    return {arm for arm, value in source.arms.items() if value.right_of_way == "priority"}


def streams_of(source: MapSource) -> list[Stream]:
    """The routes of a map as demand sees them."""
    main = main_arms(source)
    return [
        Stream(one.id, one.entry, "main" if one.entry in main else "side", source.turn(one)) for one in source.routes
    ]


def draw_drivers(
    rng: np.random.Generator, place: Place, streams: list[Stream], duration: float, temper: Temper = USUAL
) -> list[Driver]:
    """The drivers of `duration` seconds, in the order of their departure."""
    trips = sorted(_trips(rng, place, streams, duration))
    return [_driver(rng, str(number), *trip, temper=temper) for number, trip in enumerate(trips)]


def driver_like(rng: np.random.Generator, number: str, route: str, kind: str) -> Driver:
    """Draw a driver for a vehicle that is known to be of a kind, as one of `draw_drivers`.

    kind: "car", "truck_bus" or "bicycle".

    Raises:
        ValueError: another kind.
    """
    if kind not in KINDS:
        raise ValueError(f'a driver is drawn for {", ".join(KINDS)}, not for "{kind}"')
    drawn = "bicycle" if kind == "bicycle" else "vehicle"
    return _driver(rng, number, 0.0, route, drawn, truck_share=float(kind == "truck_bus"))


def write(drivers: list[Driver], route_edges: dict[str, tuple[str, ...]], path: Path, *, depart: bool = True) -> None:
    """Write the drivers as a SUMO route file, each with a vehicle type of its own: "t" and the driver's id.

    depart: False leaves the trips out, so that nobody enters.
    """
    lines = ["<routes>"]
    for route, edges in route_edges.items():
        lines.append(f'<route id="{route}" edges="{" ".join(edges)}"/>')
    for one in drivers:
        traits = " ".join(f'{key}="{value:.4f}"' for key, value in one.traits.items())
        lines.append(
            f'<vType id="t{one.id}" vClass="{one.v_class}" carFollowModel="Krauss" speedDev="0"'
            f' length="{one.length:.2f}" width="{one.width:.2f}" {traits}/>'
        )
        if not depart:
            continue
        arrival = "max" if one.arrival is None else f"{one.arrival:.2f}"
        lines.append(
            f'<vehicle id="{one.id}" type="t{one.id}" route="{one.route}" depart="{one.depart:.2f}"'
            f' departSpeed="desired" departPos="base" arrivalPos="{arrival}"/>'
        )
    path.write_text("\n".join([*lines, "</routes>", ""]), encoding="utf-8")


def _trips(
    rng: np.random.Generator, place: Place, streams: list[Stream], duration: float
) -> Iterator[tuple[float, str, str]]:
    arms = {stream.entry: stream.road for stream in streams}
    for begin in np.arange(0.0, duration, BLOCK):
        for arm, road in arms.items():
            mean = place.main_flow if road == "main" else place.side_flow
            flow = mean * rng.lognormal(-(BLOCK_SPREAD**2) / 2, BLOCK_SPREAD)
            for kind, rate in (("vehicle", flow), ("bicycle", BICYCLE_FLOW / len(arms))):
                for _ in range(rng.poisson(rate * BLOCK / 3600.0)):
                    mine = [stream for stream in streams if stream.entry == arm]
                    share = np.array([TURNS[road][stream.turn] for stream in mine])
                    route = mine[rng.choice(len(mine), p=share / share.sum())].route
                    yield round(float(begin + rng.uniform(0.0, BLOCK)), 2), route, kind


def _driver(
    rng: np.random.Generator,
    number: str,
    depart: float,
    route: str,
    kind: str,
    truck_share: float = TRUCK_SHARE,
    temper: Temper = USUAL,
) -> Driver:
    """Draw a driver: one latent aggressiveness moves all traits together."""
    aggressive = rng.normal()

    def trait(mean: float, spread: float, low: float, high: float, pull: float = 0.6) -> float:
        value = mean + temper.spread * spread * (pull * aggressive + np.sqrt(1.0 - pull**2) * rng.normal())
        return float(np.clip(value, *_limits(mean, low, high, temper.spread)))

    traits = {
        "speedFactor": temper.pace * trait(0.94, 0.11, 0.65, 1.25),
        "accel": trait(2.1, 0.45, 1.1, 3.2),
        "decel": trait(2.0, 0.5, 1.2, 3.5),
        "emergencyDecel": 5.5,
        "tau": trait(1.2, 0.3, 0.7, 2.2, -0.6),
        "minGap": trait(2.0, 0.5, 1.0, 3.5, -0.6),
        "sigma": float(rng.uniform(0.1, 0.6)),
        "jmTimegapMinor": trait(-0.9, 1.0, -2.5, 1.5, -0.6),
        "impatience": float(rng.uniform(0.6, 1.0)),
        "jmStoplineGap": 0.4,
        "jmStoplineGapMinor": float(rng.uniform(0.0, 0.7)),
        "maxSpeed": 30.0,
    }
    cornering = trait(2.2, 0.8, 1.0, 4.5)
    v_class = min(CORNERING, key=lambda one: abs(CORNERING[one] - cornering))
    if kind == "bicycle":
        slow = {"maxSpeed": trait(4.8, 0.6, 3.6, 6.2), "accel": 1.2, "decel": 2.5, "minGap": 1.0}
        return Driver(number, depart, route, kind, "bicycle", 1.8, BICYCLE_WIDTH, traits | slow)
    if rng.random() < truck_share:
        v_class = min(CORNERING, key=CORNERING.__getitem__)
        heavy = {"accel": 1.4, "decel": 2.5, "speedFactor": min(traits["speedFactor"], 1.0)}
        size = round(float(rng.uniform(6.5, 10.5)), 2), round(float(rng.uniform(2.3, 2.55)), 2)
        return Driver(number, depart, route, "truck_bus", v_class, *size, traits | heavy)
    size = round(trait(4.4, 0.35, 3.5, 5.4, 0.0), 2), round(trait(1.8, 0.08, 1.6, 2.05, 0.0), 2)
    return Driver(number, depart, route, "car", v_class, *size, traits)


def _limits(mean: float, low: float, high: float, spread: float) -> tuple[float, float]:
    """A trait's limits, so many times as far from its mean; but who must be above 0 is above half its lower limit."""
    least = mean + spread * (low - mean)
    return max(least, 0.5 * low) if low > 0.0 else least, mean + spread * (high - mean)
