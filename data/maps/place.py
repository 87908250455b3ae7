"""Moves a map to where recorded cars drive, where both lie in other metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from data.maps.lanelets import LaneMap
from data.recording import VEHICLES, Recording

MOVING = 2.0  # [m/s], ours: who is slower shows no heading
ROWS = 400  # ours: so many places of cars are compared
CELL = 1.0  # [m]
TURNS = 16  # ours: headings are compared in so many directions
NEAR = 1.5  # [m], ours: a car on its lane is nearer to its middle
LEAST = 0.6  # ours: share of the places that have to lie on a lane of their heading

Floats = NDArray[np.float64]


def on_lanes(lane_map: LaneMap, recordings: Sequence[Recording]) -> float:
    """The share of places at which cars drive that lie on a lane of their heading."""
    places, turn = _driven(recordings)
    return float(_near(lane_map, places, turn).mean())


def shift_to(lane_map: LaneMap, recordings: Sequence[Recording]) -> tuple[float, float, float]:
    """By how much the map has to move east and north [m] for most cars to drive on its lanes, and their share then.

    Turned or scaled maps are not found.

    Raises:
        ValueError: nobody drives in the recordings, or at no place most of them are on lanes of their heading.
    """
    places, turn = _driven(recordings)
    raster, origin = _raster(lane_map)
    least, most = places.min(axis=0), places.max(axis=0)
    size = np.array(raster.shape[1:]) * CELL
    best = (-1.0, 0.0, 0.0)
    for east in np.arange(origin[0] - least[0] - 5.0, origin[0] + size[0] - most[0] + 5.0, CELL):
        for north in np.arange(origin[1] - least[1] - 5.0, origin[1] + size[1] - most[1] + 5.0, CELL):
            cell = np.floor((places + np.array([east, north]) - origin) / CELL).astype(np.int64)
            inside = ((cell >= 0) & (cell < raster.shape[1:])).all(axis=1)
            hit = raster[turn[inside], cell[inside, 0], cell[inside, 1]].sum() / len(places)
            best = max(best, (float(hit), float(east), float(north)))
    tried = [
        (float(_aside(lane_map, places + np.array([east, north]), turn)), east, north)
        for east in best[1] + np.arange(-1.5, 1.6, 0.5)
        for north in best[2] + np.arange(-1.5, 1.6, 0.5)
    ]
    _, east, north = min(tried)
    share = float(_near(lane_map, places + np.array([east, north]), turn).mean())
    if share < LEAST:
        raise ValueError(
            f"the recordings' cars drive on the map's lanes nowhere: at best {100 * share:.0f} % of them are on a lane"
            f" of their heading, {100 * LEAST:.0f} % wanted; is it another place, or turned?"
        )
    return -float(east), -float(north), share


def _driven(recordings: Sequence[Recording]) -> tuple[Floats, NDArray[np.int64]]:
    """Places (place, 2) [m] at which vehicles drive, evenly chosen, and their directions (place,), of `TURNS`."""
    points, headings = [], []
    for one in recordings:
        vehicle = np.repeat([user in VEHICLES for user in one.road_user], np.diff(one.offsets))
        rows = vehicle & (np.hypot(*one.velocity.T) > MOVING)
        points.append(np.stack([one.x[rows], one.y[rows]], axis=1))
        headings.append(np.arctan2(one.velocity[rows, 1], one.velocity[rows, 0]))
    places, heading = np.concatenate(points), np.concatenate(headings)
    if not len(places):
        raise ValueError("nobody drives in the recordings, so they do not show where the map lies")
    chosen = np.linspace(0, len(places) - 1, min(ROWS, len(places))).astype(np.int64)
    return places[chosen], _turn(heading[chosen])


def _turn(heading: Floats) -> NDArray[np.int64]:
    return np.rint(heading / (2.0 * np.pi) * TURNS).astype(np.int64) % TURNS


def _centres(lane_map: LaneMap) -> tuple[Floats, NDArray[np.int64]]:
    """Places on all centrelines, and the directions there."""
    lines = [one.centre()[0] for one in lane_map.lanelets.values()]
    ways = [np.gradient(line, axis=0) for line in lines]
    east, north = np.concatenate(ways).T
    return np.concatenate(lines), _turn(np.arctan2(north, east))


def _raster(lane_map: LaneMap) -> tuple[NDArray[np.bool_], Floats]:
    """(direction, column, row): whether a lane of about this direction is near; and where the first cell lies."""
    points, turn = _centres(lane_map)
    origin = points.min(axis=0) - 3.0
    cell = np.floor((points - origin) / CELL).astype(np.int64)
    raster = np.zeros((TURNS, *(cell.max(axis=0) + 4)), dtype=np.bool_)
    for way in (-1, 0, 1):
        for east in (-1, 0, 1):
            for north in (-1, 0, 1):
                raster[(turn + way) % TURNS, cell[:, 0] + east, cell[:, 1] + north] = True
    return raster, origin


def _distances(lane_map: LaneMap, places: Floats, turn: NDArray[np.int64]) -> Floats:
    """How far each place is from the next centreline of about its direction [m]."""
    points, way = _centres(lane_map)
    far = np.full(len(places), np.inf)
    for direction in np.unique(turn):
        own = points[((way - direction + 1) % TURNS) <= 2]
        here = turn == direction
        if len(own):
            far[here] = shapely.distance(shapely.multipoints(own), shapely.points(places[here]))
    return far


def _near(lane_map: LaneMap, places: Floats, turn: NDArray[np.int64]) -> NDArray[np.bool_]:
    return _distances(lane_map, places, turn) < NEAR


def _aside(lane_map: LaneMap, places: Floats, turn: NDArray[np.int64]) -> float:
    return float(np.minimum(_distances(lane_map, places, turn), 2.0 * NEAR).mean())
