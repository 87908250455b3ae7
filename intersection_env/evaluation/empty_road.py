"""How fast a driver is with nobody else there: one that stands on an empty road predicts nobody well."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import STEPS
from intersection_env.maps.intersection import Intersection, Route, Sample, shipped_maps
from intersection_env.prediction.predictor import Predictor
from intersection_env.traffic import Traffic, Vehicle

REFERENCE = "idm_calibrated"
"""Whose speed is wanted."""
FROM_LINE, FROM_EXIT = (-60.0, -30.0, -10.0, -3.0), (5.0, 20.0)
"""Starts, from the stop line and from the junction's end [m]; one more is halfway through the junction."""
SPEEDS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""At the start, as shares of what is allowed there."""

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class EmptyRoad:
    """How fast a driver's cars are after 10 s alone."""

    least: float
    """The smallest share of the reference's speed."""
    mean: float
    """The mean of these shares."""
    where: str
    """The drive of the smallest share, in words."""
    drives: int

    def figures(self) -> dict[str, float]:
        """The shares, as a training's metrics have them."""
        return {"least": round(self.least, 4), "mean": round(self.mean, 4)}


def empty_road(
    predictor: Predictor, reference: Predictor | None = None, maps: Iterable[Intersection] | None = None
) -> EmptyRoad:
    """Drives one car alone over every route, from many starts, and compares its speed after 10 s with another's.

    That is the reference's from the same start; or, where that is less, the one at which the reference passes the place
    in free drive, as whoever is faster may have come to a bend or a lower limit. A start from which the reference
    leaves the map within 10 s, or then stands, is left out. Stops count as made.

    Args:
        predictor: who drives.
        reference: with whom to compare; None: the calibrated IDM that ships.
        maps: to drive on; None: all that ship.

    Raises:
        ValueError: no start is left.
    """
    reference = Predictor.load(REFERENCE) if reference is None else reference
    maps = [Intersection.load(name) for name in shipped_maps()] if maps is None else maps
    shares: list[float] = []
    words: list[str] = []
    for intersection in maps:
        for route in intersection.routes:
            free = free_drive(reference, intersection, route)
            for position, speed in _starts(intersection, route):
                theirs, other_speed, stays = _after_10_s(reference, intersection, route, position, speed)
                if not stays or other_speed == 0.0:
                    continue
                place, own_speed, _ = _after_10_s(predictor, intersection, route, position, speed)
                wanted = min(other_speed, float(np.interp(place, *free)))
                shares.append(own_speed / wanted)
                words.append(
                    f"{intersection.name}, {route.id}, from {position - route.stop_line:+.0f} m of its line at"
                    f" {speed:.1f} m/s: {own_speed:.1f} m/s at {place - route.stop_line:+.0f} m, {reference.name}"
                    f" {other_speed:.1f} m/s at {theirs - route.stop_line:+.0f} m"
                )
    if not shares:
        raise ValueError(f"empty road: {reference.name} leaves the map, or stands, after 10 s from every start")
    least = int(np.argmin(shares))
    return EmptyRoad(shares[least], float(np.mean(shares)), words[least], len(shares))


def _starts(intersection: Intersection, route: Route) -> Iterator[tuple[float, float]]:
    """Positions and speeds."""
    begin, end = route.junction
    places = [route.stop_line + one for one in FROM_LINE] + [0.5 * (begin + end)] + [end + one for one in FROM_EXIT]
    for place in places:
        if 0.0 < place < route.length:
            allowed = float(intersection.sample(route.index, np.array([place], np.float32))[0, Sample.V_MAX])
            yield from ((place, share * allowed) for share in SPEEDS)


def alone(intersection: Intersection, route: Route, position: float, speed: float) -> Traffic:
    """One car; it has made its stop already, where one is to be made, as a stop is no standing on an empty road."""
    traffic = Traffic.of(intersection, [Vehicle("alone", route.id, position, speed)])
    if not route.must_stop:
        return traffic
    goes, holds, since = np.zeros(1, np.bool_), np.full(1, -1, np.int16), np.ones(1, np.int32)
    return replace(traffic, delta=goes, hold=holds, waited=since)


def _after_10_s(
    predictor: Predictor, intersection: Intersection, route: Route, position: float, speed: float
) -> tuple[float, float, bool]:
    """Position, speed and whether the car is still on the map; it is where it left if not."""
    found = predictor.predict(alone(intersection, route, position, speed))
    return float(found.position[0, -1, 0]), float(found.speed[0, -1, 0]), bool(found.present[0, -1, 0])


def free_drive(predictor: Predictor, intersection: Intersection, route: Route) -> tuple[Floats, Floats]:
    """Positions [m] and speeds [m/s] of a car that drives alone over a whole route, as fast as is allowed at first."""
    positions, speeds = [np.zeros(1, np.float32)], [route.samples[:1, Sample.V_MAX]]
    while True:
        begin = alone(intersection, route, float(positions[-1][-1]), float(speeds[-1][-1]))
        found = predictor.predict(begin)
        inside = np.flatnonzero(found.present[0, 1:, 0]) + 1
        positions.append(found.position[0, inside, 0])
        speeds.append(found.speed[0, inside, 0])
        stands = len(inside) and positions[-1][-1] <= begin.position[0]
        if len(inside) < STEPS or stands:
            return np.concatenate(positions), np.concatenate(speeds)
